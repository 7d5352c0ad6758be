"""What must hold of a site after all accidents.

What could be saved is there, once, as it was; what could not be saved is missing and never something else, and where
the product had it once and has lost it, the operator was told.
"""

import hashlib
from collections.abc import Iterable, Iterator
from itertools import pairwise

from accidents import CLOCK_STEP_S, KEEPERS
from judged import once
from network import Sent
from simulated_site import EARLIER_AT_S, Site
from windows import MARGIN_S, Way, blocked, until_s

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.bus.keys import alarm_key, sample_key
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S
from wetwell.services.doctor.verify import verify_kept
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import StoreError

Key = tuple[int, int]
"""Time and number of a sample."""
NEVER_S = float("-inf")
LOOKS = 6
"""So often the historian looks through a part of what it keeps until it has seen all of it."""
ANSWERED_S = 120.0
"""In which a detector that begins has asked the historian and got its answer."""


def broken_rules(site: Site) -> list[str]:
    """In words; empty if all is well."""
    with site.heard():
        rules = (_judged, _verdicts, _verified, _history, _alarms, _told_late)
        return [*site.crashes, *(broken for rule in rules for broken in rule(site))]


def fingerprint(site: Site) -> str:
    """The same for the same seed."""
    digest = hashlib.sha256(repr(site.accidents).encode())
    for told in (site.told, site.alarms):
        digest.update(repr(sorted((str(key), repr(list(value))) for key, value in told.items())).encode())
    return digest.hexdigest()


def _judged(site: Site) -> Iterator[str]:
    """The detector was given what was published, as far as it could get there since it last went on from a file."""
    for station in site.judged.unknown:
        yield f"{station}: the detector went on from a state that no detector was in"
    way = Way(site, "gateway", "detector", MARGIN_S)
    restarts = [span.end_s for span in site.spans if (span.what, span.name) == ("away", "detector")]
    for station in site.stations:
        published = _published(site, station)
        known = {key: one.payload for key, one in published.items()}
        branches = site.judged.branches.get(station.name, [[]])
        for sample in once(branches[-1]):
            if known.get(key_of(sample)) != sample.encode():
                yield f"{station.name}: sample {key_of(sample)} was judged, but never published like that"
        given = {key_of(sample) for sample in branches[-1]}
        begin_s = max(restarts, default=NEVER_S)
        sent = list(published.values())
        missing = [
            place
            for place, (key, one) in enumerate(published.items())
            if key not in given and way.is_open(max(one.at_s, begin_s), until_s(site, sent, place))
        ]
        if missing:
            first = sent[missing[0]]
            yield f"{station.name}: {len(missing)} samples were never judged, the first from {first.at_s:.0f} s"
        yield from _made_up_for(site, station.name, published)


def _made_up_for(site: Site, station: str, published: dict[Key, Sent]) -> Iterator[str]:
    """What the historian had when the detector went on from a file, and what was behind that, was judged.

    Once a clock was set "behind" has no meaning, and files of the historian that were harmed may have lost it.
    """
    asks = Way(site, "historian", "detector", ANSWERED_S), Way(site, "detector", "historian", ANSWERED_S)
    keeps, sent = Way(site, "gateway", "historian", _commit_s(site)), list(published.values())
    clocks_s = [accident.at_s for accident in site.plan if accident.kind.startswith("clock")]
    until = min([*clocks_s, _harms_s(site)[0]])
    for life in site.judged.lives.get(station, []):
        begin_s, end_s = life.at_s, life.at_s + ANSWERED_S
        if not life.length or end_s > until or not all(way.is_open(begin_s, end_s) for way in asks):
            continue
        last_ns = max(sample.time for sample in life.branch[: life.length])
        given = {key_of(sample) for sample in life.branch}
        missing = [
            one.at_s
            for place, (key, one) in enumerate(published.items())
            if key[0] > last_ns
            and key not in given
            and keeps.is_open(one.at_s, min(until_s(site, sent, place), begin_s))
        ]
        if missing:
            yield f"{station}: {len(missing)} samples that were kept were never judged, such as of {missing[0]:.0f} s"


def _verdicts(site: Site) -> Iterator[str]:
    """The stream of verdicts is that of a detector that gets once and in order what this one was given.

    Where a clock went back, the historian gives samples in another order than the bus, and some may be judged twice:
    there it is that of a detector which gets just the same. Who comes at the end hears the last of each pump.
    """
    for station in site.stations:
        branches = site.judged.branches.get(station.name, [[]])
        branches = branches if is_stepped(site) else [once(branch) for branch in branches]
        heard = site.told.get(station.name, {}).keys()
        stream = _verdicts_on(station, branches[-1])
        wanted = {verdict.encode() for verdict in stream}
        last = {verdict.pump: verdict for verdict in stream}
        if untold := {verdict.encode() for verdict in last.values()} - site.verdicts_late:
            yield f"{station.name}: who comes late does not hear the last verdict of a pump, {_begin(untold)}"
        yield from _alarmed(site, station.name, last)
        if missing := wanted - heard:
            yield f"{station.name}: {len(missing)} of {len(wanted)} verdicts were not told, such as {_begin(missing)}"
        for branch in branches[:-1]:
            if heard <= wanted:
                break
            if [key_of(sample) for sample in branch] != [key_of(sample) for sample in branches[-1][: len(branch)]]:
                wanted |= {verdict.encode() for verdict in _verdicts_on(station, branch)}
        if more := heard - wanted:
            yield f"{station.name}: {len(more)} verdicts should not have been told, such as {_begin(more)}"


def _verdicts_on(station: Station, samples: Iterable[Sample]) -> list[Verdict]:
    detector = Detector(station.name, datasheet_of(station))
    return [verdict for sample in samples for verdict in detector.update(sample)]


def _alarmed(site: Site, station: str, last: dict[int, Verdict]) -> Iterator[str]:
    """The alarm of a pump stands as its last verdict says, if that is the newest that alarms have ever heard."""
    for pump, verdict in last.items():
        times_ns = [told.time for told in site.told.get(station, {}).values() if told.pump == pump]
        faults = verdict.standing()
        if faults is None or sum(time_ns >= verdict.time for time_ns in times_ns) != 1:
            continue
        changes = site.alarms.get((station, f"pump{pump}.pump_fault"), [])
        is_standing = bool(changes) and changes[-1].is_active
        if is_standing != any(fault.asset == f"pump:{pump}" for fault in faults):
            yield f"{station}: the alarm of pump {pump} does not stand as its last verdict says, {verdict.state}"


def is_stepped(site: Site) -> bool:
    """Whether a clock was set."""
    return any(accident.startswith("clock") for accident in site.accidents)


def _history(site: Site) -> Iterator[str]:
    """What was published was kept, once, as it was."""
    harms = [harm for harm in site.harms if harm.name == "historian"]
    is_told = any(harm.kind == "backup" for harm in harms) or any(
        finding.check == "history" and finding.level == "error" for finding in verify_kept(site.settings)
    )
    store = site.kept()
    for station in site.stations:
        try:
            samples = store.samples(station.name, 0, MAX_STAMP_NS)
            verdicts = store.events("verdicts", station.name, 0, MAX_STAMP_NS, 1_000_000)
        except StoreError as error:
            if not harms:
                yield f"{station.name}: its history cannot be read: {error}"
            continue
        published = _published(site, station)
        yield from _kept(station.name, samples, published)
        yield from _lost_samples(site, station.name, samples, published, is_told=is_told)
        yield from _given_up(site, station.name, samples, published)
        yield from _lost_verdicts(site, station.name, verdicts)
    yield from _lost_alarms(site, store)
    store.close()


def _harms_s(site: Site) -> tuple[float, float]:
    """When files of the historian were harmed first and last."""
    at_s = [harm.at_s for harm in site.harms if harm.name == "historian"]
    return min(at_s, default=float("inf")), max(at_s, default=NEVER_S)


def _commit_s(site: Site) -> float:
    return 2.0 * site.settings.historian.commit_s + MARGIN_S


def _looked_through_s(site: Site) -> float:
    """In which the historian has looked through all that it keeps, if nothing keeps it from that."""
    return LOOKS * site.settings.historian.maintain_s + MARGIN_S


class Offers:
    """When the historian can take what was sent: at once, or anew after its files were harmed.

    It takes anew what publishers keep when it begins, when it has told that something is damaged, and when it has had
    the time to find that.
    """

    def __init__(self, site: Site, sender: str) -> None:
        _, self._last_s = _harms_s(site)
        self._way = Way(site, sender, "historian", _commit_s(site))
        looked_s = _looked_through_s(site)
        searched = Way(site, "historian", "historian", looked_s).free_s(self._last_s, site.seconds)
        full = blocked(site.spans, ["machine"], ["full"])
        told = [
            told.at_s
            for told in site.log
            if told.logger.startswith("wetwell.services.historian.store")
            and not any(begin_s <= told.at_s <= end_s for begin_s, end_s in full)
        ]
        begun = [span.end_s for span in site.spans if (span.what, span.name) == ("away", "historian")]
        found = [] if searched is None else [searched + looked_s]
        self._again = [at_s for at_s in [*begun, *told, *found] if at_s >= self._last_s]

    def could_be_kept(self, at_s: float, end_s: float) -> bool:
        """Whether what was sent then, and could be had until the end, could be kept for good."""
        begins = [at_s] if at_s >= self._last_s else self._again
        return any(self._way.is_open(begin_s, end_s) for begin_s in begins)

    def was_open(self, at_s: float, end_s: float) -> bool:
        """Whether it could be kept at all, whatever became of it."""
        return self._way.is_open(at_s, end_s)


def _given_up(site: Site, station: str, samples: Samples, published: dict[Key, Sent]) -> Iterator[str]:
    """What could still be read when the files were harmed last is there."""
    kept = set(zip(samples.time_ns.tolist(), samples.seq.tolist(), strict=True))
    gone = (site.readable.get(station, set()) & published.keys()) - kept
    if gone:
        yield f"{station}: {len(gone)} samples that could still be read were given up, the first of {min(gone)[0]} ns"


def _lost_samples(
    site: Site, station: str, samples: Samples, published: dict[Key, Sent], *, is_told: bool
) -> Iterator[str]:
    """What could be kept since the last harm was; what was kept before and is lost was told."""
    first_s, _ = _harms_s(site)
    offers = Offers(site, "gateway")
    kept = set(zip(samples.time_ns.tolist(), samples.seq.tolist(), strict=True))
    sent = list(published.values())
    missing = [
        (one.at_s, until_s(site, sent, place))
        for place, (key, one) in enumerate(published.items())
        if key not in kept
    ]
    lost = [at_s for at_s, end_s in missing if offers.could_be_kept(at_s, end_s)]
    if lost:
        yield f"{station}: {len(lost)} samples that could be kept were not, the first from {lost[0]:.0f} s"
    if not is_told and not is_told_since(site, first_s):
        gone = [at_s for at_s, end_s in missing if at_s == EARLIER_AT_S or offers.was_open(at_s, end_s)]
        if gone:
            yield f"{station}: the sample of {gone[0]:.0f} s was kept and is lost, and nobody was told"


def _lost_verdicts(site: Site, station: str, verdicts: list[bytes]) -> Iterator[str]:
    """Verdicts that were told are kept, each once, and no others."""
    told = site.told.get(station, {})
    if len(verdicts) != len(set(verdicts)) or set(verdicts) - told.keys():
        yield f"{station}: the history has verdicts twice, or some that nobody told"
    offers = Offers(site, "detector")
    lost = {
        payload
        for payload in told.keys() - set(verdicts)
        if any(offers.could_be_kept(at_s, _end_s(site, payload, at_s)) for at_s in site.heard_s[payload])
    }
    if lost:
        yield f"{station}: {len(lost)} verdicts were told, but not kept, such as {_begin(lost)}"


def _lost_alarms(site: Site, store: FolderStore) -> Iterator[str]:
    """The last that was said of each alarm is kept; of the site itself too."""
    offers = Offers(site, "alarms")
    for (station, name), changes in site.alarms.items():
        try:
            kept = set(store.events("alarms", station, 0, MAX_STAMP_NS, 1_000_000))
        except StoreError:
            continue  # told as that of the samples
        sent = [one for one in site.network.sent[alarm_key(station, name)] if one.payload == changes[-1].encode()]
        if not kept & {one.payload for one in sent} and any(
            offers.could_be_kept(one.at_s, one.bus.died_s) for one in sent
        ):
            yield f"{station}: the last change of alarm {name} is not in the history"


def is_told_since(site: Site, first_s: float) -> bool:
    """Whether the historian has said since then that something is wrong."""
    return any(told.at_s >= first_s and told.logger.startswith("wetwell.services.historian") for told in site.log)


def _kept(station: str, samples: Samples, published: dict[Key, Sent]) -> Iterator[str]:
    """What is kept is what was published, each once, with its values."""
    keys = list(zip(samples.time_ns.tolist(), samples.seq.tolist(), strict=True))
    if len(keys) != len(set(keys)):
        yield f"{station}: {len(keys) - len(set(keys))} samples were kept twice"
    columns = dict(zip(samples.columns, samples.values.T, strict=True))
    recording = Recording(time_ns=samples.time_ns, columns=columns)
    for number, sample in zip(samples.seq.tolist(), recording.samples(station), strict=True):
        one = published.get((sample.time, number))
        wanted = None if one is None else Sample.decode(one.payload)
        if wanted is None or wanted.model_copy(update={"quality": "good"}) != sample.model_copy(
            update={"seq": number}
        ):
            yield f"{station}: sample {number} of {sample.time} ns was kept, but never published like that"
            return


def _end_s(site: Site, payload: bytes, at_s: float) -> float:
    """Until when a verdict that was heard then can be had from who has told it."""
    told = [one for sent in site.network.sent.values() for one in sent if one.payload == payload and one.at_s <= at_s]
    return max((one.bus.died_s for one in told), default=at_s)


def _begin(payloads: set[bytes]) -> str:
    return repr(min(payloads)[:300])


def _published(site: Site, station: Station) -> dict[Key, Sent]:
    """Samples that were given to the bus, in order."""
    published: dict[Key, Sent] = {}
    for sent in site.network.sent.get(sample_key(station.name), []):
        published.setdefault(key_of(Sample.decode(sent.payload)), sent)
    return published


def key_of(sample: Sample) -> Key:
    """What tells a sample from others."""
    return sample.time, sample.seq


def _alarms(site: Site) -> Iterator[str]:
    """An alarm is raised once each time that its condition comes; every pump fault that is told raises one.

    Files of the alarms that were harmed may have it raised again; a detector that learns anew, or a clock that was
    set, may have it raised for what has returned.
    """
    step_ns = round(len(site.accidents) * CLOCK_STEP_S * NS_PER_S) if is_stepped(site) else 0
    is_harmed = any(harm.name == "alarms" for harm in site.harms)
    odd_s = [harm.at_s for harm in site.harms if harm.name in {"alarms", "detector"}]
    odd_s += [accident.at_s for accident in site.plan if accident.kind.startswith("clock")]
    full = blocked(site.spans, ["machine"], ["full"])
    for (station, name), changes in site.alarms.items():
        raised = [change.raised for change in changes if change.raised is not None]
        if any(later < earlier - step_ns for earlier, later in pairwise(raised)) and not is_harmed:
            yield f"{station}: alarm {name} goes back in time"
        for before, after in pairwise(changes):
            if before.is_active and after.is_active and after.raised != before.raised and not is_harmed:
                yield f"{station}: alarm {name} is raised twice"
            if not is_raised_anew(before, after):
                continue
            before_s, after_s = _said_s(site, before), _said_s(site, after)
            is_kept = all(end_s < before_s or begin_s > after_s for begin_s, end_s in full)
            if is_kept and after_s < min(odd_s, default=site.seconds):
                yield f"{station}: alarm {name} is raised anew for what has returned"
    way = Way(site, "detector", "alarms", MARGIN_S)
    for station in site.stations:
        told = site.told.get(station.name, {})
        faulty = _faulty_pumps(
            verdict
            for payload, verdict in told.items()
            if any(way.is_open(at_s, _end_s(site, payload, at_s)) for at_s in site.heard_s[payload])
        )
        alarmed = {pump for pump in faulty if (station.name, f"pump{pump}.pump_fault") in site.alarms}
        if faulty - alarmed:
            yield f"{station.name}: pump faults {sorted(faulty - alarmed)} raised no alarm"


def _said_s(site: Site, alarm: Alarm) -> float:
    """When an alarm was told like that first. [s]"""
    sent = site.network.sent[alarm_key(alarm.station, alarm.id)]
    return min(one.at_s for one in sent if one.payload == alarm.encode())


def is_raised_anew(before: Alarm, after: Alarm) -> bool:
    """Whether an alarm that had returned is back with the time at which it was raised before, or an earlier one."""
    if before.is_active or not after.is_active or before.raised is None or after.raised is None:
        return False
    return after.raised <= before.raised


def _told_late(site: Site) -> Iterator[str]:
    """Who comes at the end hears of each alarm that stands, where the alarms could keep it and say what became."""
    if any(harm.name == "alarms" for harm in site.harms):
        return
    in_the_way = blocked(site.spans, ["alarms", "machine"], ["mute", "stalled", "full", "slow"])
    for (station, name), changes in site.alarms.items():
        is_free = all(end_s < _said_s(site, changes[-1]) - MARGIN_S for _, end_s in in_the_way)
        if changes[-1].is_active and is_free and (station, name) not in site.told_late:
            yield f"{station}: alarm {name} stands, and who comes late does not hear of it"


def _verified(site: Site) -> Iterator[str]:
    """What no accident has harmed is what was written; the historian has found itself what is harmed."""
    harmed = {harm.name for harm in site.harms}
    owners = {"history": {"historian"}, "detector": {"detector"}, "alarms": {"alarms"}, "audit": set(KEEPERS)}
    _, last_s = _harms_s(site)
    way = Way(site, "historian", "historian", _looked_through_s(site))
    is_looked_through = way.is_open(last_s, site.seconds)
    for finding in verify_kept(site.settings):
        if finding.level != "error":
            continue
        if not owners[finding.check] & harmed:
            yield f"doctor --verify: {finding}"
        elif finding.check == "history" and is_looked_through:
            yield f"the historian has not found what doctor --verify finds: {finding}"


def _faulty_pumps(verdicts: Iterable[Verdict]) -> set[int]:
    """Pumps with a fault that alarms must have heard of; they may leave out verdicts not newer than the last."""
    faulty: set[int] = set()
    newest_ns: dict[int, int] = {}
    for verdict in verdicts:
        if verdict.time > newest_ns.get(verdict.pump, verdict.time - 1):
            newest_ns[verdict.pump] = verdict.time
            if verdict.state == "pump_fault":
                faulty.add(verdict.pump)
    return faulty
