"""What must hold of a site after all accidents."""

import hashlib
from collections.abc import Iterable, Iterator
from itertools import pairwise

from accidents import CLOCK_STEP_S
from simulated_site import Site

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.bus.keys import sample_key
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S


def broken_rules(site: Site) -> list[str]:
    """In words; empty if all is well."""
    return [*_verdicts(site), *_history(site), *_alarms(site)]


def fingerprint(site: Site) -> str:
    """The same for the same seed."""
    digest = hashlib.sha256(repr(site.accidents).encode())
    for told in (site.told, site.alarms):
        digest.update(repr(sorted((str(key), repr(list(value))) for key, value in told.items())).encode())
    return digest.hexdigest()


def _verdicts(site: Site) -> Iterator[str]:
    """The stream of verdicts is that of a detector that gets each published sample once, in order."""
    for station in site.stations:
        detector = Detector(station.name, datasheet_of(station))
        wanted = {verdict.encode() for sample in _samples(site, station) for verdict in detector.update(sample)}
        heard = site.told.get(station.name, {}).keys()
        if missing := wanted - heard:
            yield f"{station.name}: {len(missing)} of {len(wanted)} verdicts were not told, such as {_begin(missing)}"
        if more := heard - wanted:
            yield f"{station.name}: {len(more)} verdicts should not have been told, such as {_begin(more)}"


def _history(site: Site) -> Iterator[str]:
    """What was published was kept, once."""
    store = site.kept()
    for station in site.stations:
        published = {(sample.time, sample.seq) for sample in _samples(site, station)}
        samples = store.samples(station.name, 0, MAX_STAMP_NS)
        kept = list(zip(samples.time_ns.tolist(), samples.seq.tolist(), strict=True))
        if kept != sorted(published):
            yield f"{station.name}: {len(kept)} samples were kept of {len(published)}"
        verdicts = store.events("verdicts", station.name, 0, MAX_STAMP_NS, 1_000_000)
        if len(verdicts) != len(set(verdicts)) or set(verdicts) != site.told.get(station.name, {}).keys():
            yield f"{station.name}: {len(verdicts)} verdicts were kept of {len(site.told.get(station.name, {}))}"
    store.close()


def _begin(payloads: set[bytes]) -> str:
    return repr(min(payloads)[:300])


def _samples(site: Site, station: Station) -> list[Sample]:
    return [Sample.decode(payload) for payload in site.published.get(sample_key(station.name), [])]


def _alarms(site: Site) -> Iterator[str]:
    """An alarm is raised once each time that its condition comes; every pump fault that is told raises one."""
    is_stepped = any(accident.startswith("clock") for accident in site.accidents)
    step_ns = round(CLOCK_STEP_S * NS_PER_S) if is_stepped else 0
    for (station, name), changes in site.alarms.items():
        raised = [change.raised for change in changes if change.raised is not None]
        if any(later < earlier - step_ns for earlier, later in pairwise(raised)):
            yield f"{station}: alarm {name} goes back in time"
        for before, after in pairwise(changes):
            if before.is_active and after.is_active and after.raised != before.raised:
                yield f"{station}: alarm {name} is raised twice"
    for station in site.stations:
        faulty = _faulty_pumps(site.told.get(station.name, {}).values())
        alarmed = {pump for pump in faulty if (station.name, f"pump{pump}.pump_fault") in site.alarms}
        if faulty - alarmed:
            yield f"{station.name}: pump faults {sorted(faulty - alarmed)} raised no alarm"


def _faulty_pumps(verdicts: Iterable[Verdict]) -> set[int]:
    """Pumps with a fault that alarms must have heard of; they may leave out verdicts that are older than the last."""
    faulty: set[int] = set()
    newest_ns: dict[int, int] = {}
    for verdict in verdicts:
        if verdict.time >= newest_ns.get(verdict.pump, verdict.time):
            newest_ns[verdict.pump] = verdict.time
            if verdict.state == "pump_fault":
                faulty.add(verdict.pump)
    return faulty
