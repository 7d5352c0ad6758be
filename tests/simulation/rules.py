"""What must hold of a site after all accidents.

What could be saved is there, once, as it was; what could not be saved is missing and never something else, and where
the product had it once and has lost it, the operator was told.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from accidents import CLOCK_STEP_S, KEEPERS
from judged import once
from kept_rules import history_rules
from network import Sent
from offers import EVER_S, NEVER_S, commit_s, harms_s, looked_through_s
from published import Key, begin_of, key_of, published_by, until_gone_s
from simulated_site import Site
from windows import MARGIN_S, Way, blocked, until_s

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.bus.keys import alarm_key
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S, from_iso
from wetwell.services.doctor.verify import verify_kept

ANSWERED_S = 120.0
"""In which a detector that begins has asked the historian and got its answer."""
_SAID_LOST = re.compile(r"station '(.+)' pump (\d+): verdicts up to (\S+) are lost:")


def broken_rules(site: Site) -> list[str]:
    """In words; empty if all is well."""
    with site.heard():
        rules = (_judged, _verdicts, _verified, history_rules, _alarms, _told_late)
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
        published = published_by(site, station.name)
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
            if key not in given and way.is_open(max(one.at_s, begin_s), until_s(sent, place, site.kept_samples))
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
    keeps, sent = Way(site, "gateway", "historian", commit_s(site)), list(published.values())
    clocks_s = [accident.at_s for accident in site.plan if accident.kind.startswith("clock")]
    until = min([*clocks_s, harms_s(site)[0]])
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
            and keeps.is_open(one.at_s, min(until_s(sent, place, site.kept_samples), begin_s))
        ]
        if missing:
            yield f"{station}: {len(missing)} samples that were kept were never judged, such as of {missing[0]:.0f} s"


def _verdicts(site: Site) -> Iterator[str]:
    """The stream of verdicts is that of a detector that gets once and in order what this one was given.

    Where a clock went back, the historian gives samples in another order than the bus, and some may be judged twice:
    there it is that of a detector which gets just the same. Who comes at the end hears the last of each pump.
    What nobody has heard is told again by each life of the detector, or said to be lost.
    """
    for station in site.stations:
        branches = site.judged.branches.get(station.name, [[]])
        branches = branches if is_stepped(site) else [once(branch) for branch in branches]
        heard = site.told.get(station.name, {}).keys()
        stream = _verdicts_on(station, branches[-1])
        wanted = {verdict.encode() for verdict in stream}
        last = {verdict.pump: verdict for verdict in stream}
        if untold := {verdict.encode() for verdict in last.values()} - site.verdicts_late:
            yield f"{station.name}: who comes late does not hear the last verdict of a pump, {begin_of(untold)}"
        yield from _alarmed(site, station.name, last)
        if missing := {payload for payload in wanted - heard if not _is_said_lost(site, Verdict.decode(payload))}:
            told = f"{len(missing)} of {len(wanted)} verdicts were not told"
            yield f"{station.name}: {told}, such as {begin_of(missing)}"
        for branch in _ways_of_their_own(branches):
            if heard <= wanted:
                break
            wanted |= {verdict.encode() for verdict in _verdicts_on(station, branch)}
        if more := heard - wanted:
            yield f"{station.name}: {len(more)} verdicts should not have been told, such as {begin_of(more)}"


def _is_said_lost(site: Site, verdict: Verdict) -> bool:
    """Whether the detector has said that it and those before it are lost."""
    for told in site.log:
        said = _SAID_LOST.match(told.text)
        if said and (said[1], int(said[2])) == (verdict.station, verdict.pump) and verdict.time <= from_iso(said[3]):
            return True
    return False


def _ways_of_their_own(branches: Sequence[Sequence[Sample]]) -> Iterator[Sequence[Sample]]:
    """Branches that are no beginning of a later one, without the last one."""
    keys = [[key_of(sample) for sample in branch] for branch in branches]
    for place, branch in enumerate(branches[:-1]):
        if not any(later[: len(branch)] == keys[place] for later in keys[place + 1 :]):
            yield branch


def _verdicts_on(station: Station, samples: Iterable[Sample]) -> list[Verdict]:
    detector = Detector(station.name, datasheet_of(station))
    return [verdict for sample in samples for verdict in detector.update(sample)]


def _alarmed(site: Site, station: str, last: dict[int, Verdict]) -> Iterator[str]:
    """The alarm of a pump stands as its last verdict says, if that is the newest that alarms have ever heard.

    Alarms whose files were harmed since they told of it may not know that it stood.
    """
    harmed_s = max((harm.at_s for harm in site.harms_of("alarms")), default=NEVER_S)
    for pump, verdict in last.items():
        times_ns = [told.time for told in site.told.get(station, {}).values() if told.pump == pump]
        faults = verdict.standing()
        if faults is None or sum(time_ns >= verdict.time for time_ns in times_ns) != 1:
            continue
        changes = site.alarms.get((station, f"pump{pump}.pump_fault"), [])
        if changes and _said_s(site, changes)[-1] <= harmed_s:
            continue
        is_standing = bool(changes) and changes[-1].is_active
        if is_standing != any(fault.asset == f"pump:{pump}" for fault in faults):
            yield f"{station}: the alarm of pump {pump} does not stand as its last verdict says, {verdict.state}"


def is_stepped(site: Site) -> bool:
    """Whether a clock was set."""
    return any(accident.startswith("clock") for accident in site.accidents)


def _alarms(site: Site) -> Iterator[str]:
    """An alarm is raised once each time that its condition comes; every pump fault that is told raises one.

    Files of the alarms that were harmed may have it raised again, and so may a restart of the alarms where a full
    disk kept nothing of it: nobody knows then that it stands, nor since when. A detector that learns anew, or a clock
    that was set, may have it raised for what has returned, and for what was before that.
    """
    step_ns = round(len(site.accidents) * CLOCK_STEP_S * NS_PER_S) if is_stepped(site) else 0
    is_harmed = any(harm.name == "alarms" for harm in site.harms)
    harmed_s = [harm.at_s for harm in site.harms if harm.name in {"alarms", "detector"}]
    odd_s = harmed_s + [accident.at_s for accident in site.plan if accident.kind.startswith("clock")]
    full = blocked(site.spans, ["machine"], ["full"])
    began_s = [span.end_s for span in site.spans if (span.what, span.name) == ("away", "alarms")]
    for (station, name), changes in site.alarms.items():
        said_s = _said_s(site, changes)
        whole = [change for change, at_s in zip(changes, said_s, strict=True) if at_s < min(harmed_s, default=EVER_S)]
        raised = [change.raised for change in whole if change.raised is not None]
        if any(later < earlier - step_ns for earlier, later in pairwise(raised)):
            yield f"{station}: alarm {name} goes back in time"
        for (before, before_s), (after, after_s) in pairwise(zip(changes, said_s, strict=True)):
            is_kept = all(end_s < before_s or begin_s > after_s for begin_s, end_s in full)
            is_known = not is_harmed and (is_kept or not any(before_s <= at_s <= after_s for at_s in began_s))
            if before.is_active and after.is_active and after.raised != before.raised and is_known:
                yield f"{station}: alarm {name} is raised twice"
            if not is_raised_anew(before, after):
                continue
            if is_kept and after_s < min(odd_s, default=site.seconds):
                yield f"{station}: alarm {name} is raised anew for what has returned"
    way = Way(site, "detector", "alarms", MARGIN_S)
    for station in site.stations:
        told = site.told.get(station.name, {})
        faulty = _faulty_pumps(
            verdict
            for payload, verdict in told.items()
            if any(way.is_open(at_s, until_gone_s(site, payload, at_s)) for at_s in site.heard_s[payload])
        )
        alarmed = {pump for pump in faulty if (station.name, f"pump{pump}.pump_fault") in site.alarms}
        if faulty - alarmed:
            yield f"{station.name}: pump faults {sorted(faulty - alarmed)} raised no alarm"


def _said_s(site: Site, changes: Sequence[Alarm]) -> list[float]:
    """When each change of an alarm was told, one after the other: alarms that begin anew may tell one again. [s]"""
    times_s: list[float] = []
    for change in changes:
        last_s = times_s[-1] if times_s else NEVER_S
        sent = site.network.sent[alarm_key(change.station, change.id)]
        told_s = (one.at_s for one in sent if one.payload == change.encode())
        times_s.append(min((at_s for at_s in told_s if at_s >= last_s), default=last_s))
    return times_s


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
        is_free = all(end_s < _said_s(site, changes)[-1] - MARGIN_S for _, end_s in in_the_way)
        if changes[-1].is_active and is_free and (station, name) not in site.told_late:
            yield f"{station}: alarm {name} stands, and who comes late does not hear of it"


def _verified(site: Site) -> Iterator[str]:
    """What no accident has harmed is what was written; the historian has found itself what is harmed."""
    harmed = {harm.name for harm in site.harms}
    owners = {"history": {"historian"}, "detector": {"detector"}, "alarms": {"alarms"}, "audit": set(KEEPERS)}
    _, last_s = harms_s(site)
    way = Way(site, "historian", "historian", looked_through_s(site))
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
