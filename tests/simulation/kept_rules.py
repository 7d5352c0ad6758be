"""What must hold of a history: what was published is kept, once, as it was, and nothing is given up."""

from collections.abc import Collection, Iterator
from itertools import takewhile
from typing import NamedTuple

import numpy as np
from network import Sent
from offers import EVER_S, NEVER_S, Offers, harms_s
from published import Key, begin_of, keys_of, published_by, samples_of, until_gone_s
from readable import Row
from simulated_site import EARLIER_AT_S, MOST_ASKED, Answer, Site, Stocktaking
from windows import until_s

from wetwell.protocols.bus.keys import alarm_key
from wetwell.protocols.timestamps import MAX_STAMP_NS
from wetwell.services.doctor.verify import verify_kept
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, StoreError, day_of
from wetwell.services.historian.summary import TEN_NS, Summary

TINY = 1e-9
"""By which a mean of equal values may differ from them."""


class Stretch(NamedTuple):
    """From when on nobody harmed the files of the historian, and until when it had time to keep something."""

    harmed_s: float
    until_s: float


def history_rules(site: Site) -> Iterator[str]:
    """At the end, and each time that somebody has looked at its files."""
    published = {station.name: published_by(site, station.name) for station in site.stations}
    for taken in site.stocks:
        yield from _meanwhile(site, taken, published)
    yield from _at_the_end(site, published)


def _meanwhile(site: Site, taken: Stocktaking, published: dict[str, dict[Key, Sent]]) -> Iterator[str]:
    """Of a database in which SQLite finds something wrong little is said: the historian may yet mend it."""
    at_s, stock, harm = taken
    if harm is not None:
        yield from _given_up(harm.readable, stock.samples, published)
    if not stock.is_whole:
        return
    stretch = Stretch(NEVER_S if harm is None else harm.at_s, at_s)
    for station, sent in published.items():
        kept = {(time_ns, seq) for name, time_ns, seq in stock.samples if name == station}
        yield from _lost_samples(site, station, kept, sent, stretch)
        yield from _lost_verdicts(site, station, stock.messages, stretch)
    for station, name in site.alarms:
        yield from _lost_alarm(site, station, name, stock.messages, stretch)


def _at_the_end(site: Site, published: dict[str, dict[Key, Sent]]) -> Iterator[str]:
    harms = site.harms_of("historian")
    first_s, last_s = harms_s(site)
    stretch = Stretch(last_s, EVER_S)
    is_told = any(harm.kind == "backup" for harm in harms) or any(
        finding.check == "history" and finding.level == "error" for finding in verify_kept(site.settings)
    )
    store = site.kept()
    for station, sent in published.items():
        try:
            samples = store.samples(station, 0, MAX_STAMP_NS)
            verdicts = store.events("verdicts", station, 0, MAX_STAMP_NS, MOST_ASKED)
        except StoreError as error:
            if not harms:
                yield f"{station}: its history cannot be read: {error}"
            continue
        kept = keys_of(samples)
        wanted = samples_of(station, sent)
        for answer in [*(one for one in site.answers if one.station == station), Answer(station, samples, verdicts)]:
            yield from _as_told(site, answer, wanted)
        yield from _as_summed_up(station, store, wanted)
        yield from _lost_samples(site, station, set(kept), sent, stretch)
        if harms:
            yield from _given_up(harms[-1].readable, {(station, *key) for key in kept}, {station: sent})
        if not is_told and not is_told_since(site, first_s):
            yield from _lost_unsaid(site, station, set(kept), sent, stretch)
        yield from _lost_verdicts(site, station, verdicts, stretch)
    yield from _lost_alarms(site, store, stretch)
    store.close()


def _as_told(site: Site, answer: Answer, wanted: Samples) -> Iterator[str]:
    """What is given out is what was told, each once."""
    station, samples, verdicts = answer
    yield from _as_published(station, samples, keys_of(samples), wanted)
    if len(verdicts) != len(set(verdicts)) or set(verdicts) - site.told.get(station, {}).keys():
        yield f"{station}: the history has verdicts twice, or some that nobody told"


def _as_published(station: str, samples: Samples, keys: list[Key], wanted: Samples) -> Iterator[str]:
    """Samples are those that were published, with their values."""
    if len(keys) != len(set(keys)):
        yield f"{station}: {len(keys) - len(set(keys))} samples were kept twice"
    places = {key: place for place, key in enumerate(keys_of(wanted))}
    rows = [places.get(key, -1) for key in keys]
    pumps = max(samples.pumps, wanted.pumps)
    given, meant = samples.padded(pumps), wanted.padded(pumps)[rows]
    is_same = ((given == meant) | (np.isnan(given) & np.isnan(meant))).all(axis=1) & (np.array(rows) >= 0)
    for key in [key for key, same in zip(keys, is_same.tolist(), strict=True) if not same][:1]:
        yield f"{station}: sample {key[1]} of {key[0]} ns was kept, but never published like that"


def _as_summed_up(station: str, store: FolderStore, wanted: Samples) -> Iterator[str]:
    """A trend of ten minutes has no more values than were published then, and none beyond them."""
    start_ns = day_of(int(wanted.time_ns[0]))
    end_ns = day_of(int(wanted.time_ns[-1])) + DAY_NS
    try:
        told = store.summary(station, start_ns, end_ns, TEN_NS)
    except StoreError:
        return  # told as that of the samples
    all_of = Summary.of(wanted).over(start_ns, TEN_NS)
    places = {time_ns: place for place, time_ns in enumerate(all_of.time_ns.tolist())}
    for number, time_ns in enumerate(told.time_ns.tolist()):
        one, most = told.select(np.array([number])), all_of.select(np.array([places.get(time_ns, 0)]))
        if time_ns not in places or not is_within(one, most):
            yield f"{station}: the trend at {time_ns} ns is not one of what was published"
            return


def is_within(one: Summary, most: Summary) -> bool:
    """Whether a summary can be one of some of the values of another; of all of them it is the same."""
    if one.count.shape != most.count.shape or np.any(one.count > most.count):
        return False
    is_all, has_values = one.count == most.count, one.count > 0.0
    inside = (most.low <= one.low) & (one.low <= one.high) & (one.high <= most.high)
    inside &= (one.low <= one.mean + TINY) & (one.mean <= one.high + TINY)
    ends = (one.low == most.low) & (one.high == most.high) & np.isclose(one.mean, most.mean, rtol=1e-12)
    return bool(np.all(~has_values | np.where(is_all, ends, inside)))


def _given_up(readable: set[Row], kept: set[Row], published: dict[str, dict[Key, Sent]]) -> Iterator[str]:
    """What could still be read when the files were harmed is there."""
    gone = [row for row in readable - kept if row[1:] in published.get(row[0], {})]
    if gone:
        station, time_ns, _ = min(gone)
        yield f"{station}: {len(gone)} samples that could still be read were given up, the first of {time_ns} ns"


def _missing(
    site: Site, kept: set[Key], published: dict[Key, Sent], stretch: Stretch
) -> Iterator[tuple[float, float]]:
    """From when until when samples could be had that are not kept."""
    sent = list(published.values())
    for place, (key, one) in enumerate(published.items()):
        if key not in kept and one.at_s < stretch.until_s:
            yield one.at_s, until_s(sent, place, site.kept_samples)


def _lost_samples(
    site: Site, station: str, kept: set[Key], published: dict[Key, Sent], stretch: Stretch
) -> Iterator[str]:
    """What could be kept since the last harm was."""
    offers = Offers(site, "gateway", *stretch)
    missing = _missing(site, kept, published, stretch)
    lost = [at_s for at_s, end_s in missing if offers.could_be_kept(at_s, end_s)]
    if lost:
        yield f"{station}: {len(lost)} samples that could be kept were not, the first from {lost[0]:.0f} s"


def _lost_unsaid(
    site: Site, station: str, kept: set[Key], published: dict[Key, Sent], stretch: Stretch
) -> Iterator[str]:
    """What was kept before and is lost was told."""
    offers = Offers(site, "gateway", *stretch)
    missing = _missing(site, kept, published, stretch)
    gone = [at_s for at_s, end_s in missing if at_s == EARLIER_AT_S or offers.was_open(at_s, end_s)]
    if gone:
        yield f"{station}: the sample of {gone[0]:.0f} s was kept and is lost, and nobody was told"


def _lost_verdicts(site: Site, station: str, kept: Collection[bytes], stretch: Stretch) -> Iterator[str]:
    """Verdicts that were told are kept."""
    offers = Offers(site, "detector", *stretch)
    lost = {
        payload
        for payload in site.told.get(station, {}).keys() - set(kept)
        if any(
            offers.could_be_kept(at_s, until_gone_s(site, payload, at_s))
            for at_s in site.heard_s[payload]
            if at_s < stretch.until_s
        )
    }
    if lost:
        yield f"{station}: {len(lost)} verdicts were told, but not kept, such as {begin_of(lost)}"


def _lost_alarms(site: Site, store: FolderStore, stretch: Stretch) -> Iterator[str]:
    for station, name in site.alarms:
        try:
            kept = store.events("alarms", station, 0, MAX_STAMP_NS, MOST_ASKED)
        except StoreError:
            continue  # told as that of the samples
        yield from _lost_alarm(site, station, name, kept, stretch)


def _lost_alarm(site: Site, station: str, name: str, kept: Collection[bytes], stretch: Stretch) -> Iterator[str]:
    """The last that was said of an alarm until then is kept; of the site itself too."""
    sent = [one for one in site.network.sent[alarm_key(station, name)] if one.at_s < stretch.until_s]
    last = list(takewhile(lambda one: one.payload == sent[-1].payload, reversed(sent)))
    if not last or last[0].payload in kept:
        return
    offers = Offers(site, "alarms", *stretch)
    if any(offers.could_be_kept(one.at_s, one.bus.died_s) for one in last):
        yield f"{station}: the last change of alarm {name} is not in the history"


def is_told_since(site: Site, first_s: float) -> bool:
    """Whether the historian has said since then that something is wrong."""
    return any(told.at_s >= first_s and told.logger.startswith("wetwell.services.historian") for told in site.log)
