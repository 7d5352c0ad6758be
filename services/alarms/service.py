"""Takes what comes over the bus, keeps the alarms, publishes their changes and answers questions about them."""

import logging
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from wetwell.protocols.bus.interface import Outlet, Presence, Publisher, Request
from wetwell.protocols.bus.keys import SITE, alarm_act_key, alarm_key
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.messages.alarm import (
    STATION,
    Alarm,
    AlarmAct,
    AlarmAnswer,
    AlarmFigure,
    AlarmReport,
    AlarmState,
    Mode,
)
from wetwell.protocols.messages.decoding import M, decoded
from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import LevelSample
from wetwell.protocols.messages.sample_block import LevelBlock
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import NAME_PATTERN, Station
from wetwell.services.alarms.record import AlarmRecord
from wetwell.services.alarms.registry import SHELF, AlarmRegistry
from wetwell.services.alarms.rules import MAX_PUMPS, changed_rules
from wetwell.services.alarms.state_file import KeptSite, SiteState, StationState, site_in
from wetwell.services.alarms.station_clock import Now, went_on
from wetwell.services.alarms.station_watch import Limits, PumpVerdicts, StationWatch
from wetwell.services.alarms.status import ActRefusedError, AlarmStatus
from wetwell.services.runtime.settings import AlarmSettings
from wetwell.services.security.audit import AuditTrail, audit_in

log = logging.getLogger(__name__)

SOURCES = frozenset({"gateway", "simulator"})
"""Services whose health figures say why samples do not come."""
MAX_STATIONS = 10_000
"""Further names on the bus are refused: somebody makes them up."""

ALARM_HISTORY = 100
"""Changes of an alarm that are kept for who missed some: as many as of verdicts."""

SAVING_SHARE = 0.1
"""Of the time for which the state is being written at the most, but for acts: it is written whole."""


_MODES: Mapping[str, Mode | None] = {"maintenance": "maintenance", "stop": "stopped", "resume": None}


@dataclass(frozen=True)
class Kept:
    """Where the alarms keep their state and their audit."""

    site: KeptSite
    audit: AuditTrail


class AlarmService:
    """The alarms of a site on a bus. Synchronous; `now` gives the clocks.

    Without `kept`, state and audit are in the folder of the settings. Plants that are held (`is_held`) are not missed
    until they are let go.

    Raises
    ------
    ConfigError
        If the folder of the state cannot be used.
    """

    def __init__(
        self,
        bus: Outlet,
        settings: AlarmSettings,
        stations: Sequence[Station],
        now: Callable[[], Now],
        kept: Kept | None = None,
        *,
        is_held: bool = False,
    ) -> None:
        self._bus = bus
        self._settings = settings
        self._now = now
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self._counts: Counter[str] = Counter()
        self._lost_s: float | None = None
        self._rests_until_s = float("-inf")
        kept = kept or Kept(site_in(settings.state_dir), audit_in(settings.state_dir, "alarm"))
        self._audit, self._file = kept.audit, kept.site
        self._no_limits = limits_of(settings, None)
        self._limits = {station.name: limits_of(settings, station) for station in stations}
        rules = {name: change.model_dump(exclude_none=True) for name, change in settings.rules.items()}
        self.registry = AlarmRegistry(changed_rules(rules))
        self.stations: dict[str, StationWatch] = {}
        self._restore(self._file.load() or SiteState())
        for station in stations:
            watch = self._watch(station.name)
            watch.has_samples = True  # it is missed from the beginning
            watch.is_held = is_held
        self._watch(SITE)

    def handle_sample(self, payload: bytes) -> None:
        """Look at a sample."""
        sample = self._decoded(LevelSample, payload)
        if sample is not None:
            self._handle_samples(sample.station, [sample])

    def handle_sample_block(self, payload: bytes) -> None:
        """Look at many samples of a station."""
        block = self._decoded(LevelBlock, payload)
        if block is not None:
            self._handle_samples(block.station, block.samples())

    def _handle_samples(self, station: str, samples: Sequence[LevelSample]) -> None:
        if (watch := self._named(station)) is None:
            return
        now, limits = self._now(), self._limits.get(station) or self._no_limits
        for sample in samples:
            is_new = watch.handle_sample(sample, now, self.registry, limits)
            self._counts["samples" if is_new else "doubled"] += 1

    def handle_verdict(self, payload: bytes) -> None:
        """Look at a verdict."""
        verdict = self._decoded(Verdict, payload)
        if verdict is None or (watch := self._named(verdict.station)) is None:
            return
        if verdict.pump > MAX_PUMPS:
            self._counts["foreign"] += 1
            return
        is_new = watch.handle_verdict(verdict, self._now(), self.registry)
        self._counts["verdicts" if is_new else "doubled"] += 1

    def handle_gap(self, payload: bytes) -> None:
        """Look at the gap between a station and its simulator."""
        gap = self._decoded(GapWatch, payload)
        if gap is not None and (watch := self._named(gap.station)) is not None:
            watch.handle_gap(gap, self._now(), self.registry)

    def handle_status(self, payload: bytes) -> None:
        """Look at the health figures of a source of samples."""
        status = self._decoded(Status, payload)
        if status is not None and status.service in SOURCES and (watch := self._named(status.station)) is not None:
            watch.handle_status(status, self._now(), self.registry, self._settings.heartbeat_after_s)

    def handle_presence(self, presence: Presence) -> None:
        """Note that a service has come or gone."""
        _, station, _, service = presence.key.split("/", 3)
        watch = self.stations[SITE] if station == SITE else self._named(station)
        if watch is not None:
            watch.handle_presence(service, is_alive=presence.is_alive, now=self._now())

    def handle_act(self, request: Request) -> None:
        """Carry out an act of an operator and answer it."""
        try:
            act = AlarmAct.decode(request.payload)
        except MessageError as error:
            self._counts["malformed"] += 1
            answer = AlarmAnswer(id="", is_done=False, reason=str(error))
        else:
            if request.key == alarm_act_key(act.station):
                answer = self.carry_out(act)
            else:
                reason = f"an act on station '{act.station}' cannot come on key '{request.key}'"
                answer = AlarmAnswer(id=act.id, is_done=False, reason=reason)
        self.commit()
        request.reply(answer.encode())

    def carry_out(self, act: AlarmAct) -> AlarmAnswer:
        """Carry out an act, once for each `id`, after it was written into the audit."""
        earlier = self.registry.answered(act)
        if earlier is not None:
            return earlier
        now = self._now()
        if act.station not in self.stations:
            return AlarmAnswer(id=act.id, is_done=False, reason=f"station '{act.station}' is not known")
        try:
            if act.alarm == STATION:
                return self._set_mode(act, now)
            record, after = self.registry.after(act, now.wall_ns, self._clock_ns(act.station, now))
        except ActRefusedError as error:
            self._write_down(now, act, refused=str(error))
            return self.registry.remember(AlarmAnswer(id=act.id, is_done=False, reason=str(error)))
        if not self._write_down(now, act, before=record.status.state, after=after.state):
            return AlarmAnswer(id=act.id, is_done=False, reason="the audit cannot be written, so nothing was done")
        self._counts["acts"] += 1
        time_ns = self._clock_ns(act.station, now)
        return self.registry.carry_out(act, record, after, time_ns, now.wall_ns)

    def _set_mode(self, act: AlarmAct, now: Now) -> AlarmAnswer:
        """Put a station under maintenance, stop it, or end that."""
        modes = self.registry.modes
        before, after = modes.get(act.station), _MODES[act.act]
        if before == after:
            raise ActRefusedError(f"{act.act}: the station is {before or 'in operation'}")
        if not self._write_down(now, act, before=before or "", after=after or ""):
            return AlarmAnswer(id=act.id, is_done=False, reason="the audit cannot be written, so nothing was done")
        self._counts["acts"] += 1
        time_ns = self._clock_ns(act.station, now)
        self.registry.set_mode(act.station, after, act.by, act.reason, time_ns, now.wall_ns)
        self.save()
        return self.registry.remember(AlarmAnswer(id=act.id, is_done=True))

    def look(self) -> None:
        """Once a second: what does not come any more, shelves that end, floods."""
        now, settings = self._now(), self._settings
        for record, status in self.registry.ended_shelves(now.wall_ns):
            self._unshelve(record, status, now)
        if self._bus.is_connected:
            if self._lost_s is not None:
                self._lost_s = None
                for watch in self.stations.values():
                    watch.begin_again(now)
            for watch in self.stations.values():
                watch.look(now, self.registry, settings.stale_after_s, settings.silent_after_s)
        elif self._lost_s is None:
            self._lost_s = now.steady_s
        is_lost = self._lost_s is not None and now.steady_s - self._lost_s > settings.silent_after_s
        self.registry.observe(SITE, "bus_lost", is_lost, now.wall_ns, now.wall_ns)
        if self.registry.rates.look(now.wall_ns):
            log.warning("alarm flood has %s", "begun" if self.registry.rates.is_flood else "ended")
        self.commit_in_time()
        if self._file.errors:
            self.save()  # the disk may take it again

    def commit(self) -> None:
        """Keep what has changed, then publish it."""
        if not self.registry.changed:
            return
        self.save()
        changed, self.registry.changed = self.registry.changed, []
        for alarm in changed:
            log.info("station '%s': alarm %s is %s: %s", alarm.station, alarm.id, alarm.state, alarm.text)
            self._publish(alarm)

    def commit_in_time(self) -> None:
        """As `commit`; where the last one took long, with a later one or a later look."""
        if self._now().steady_s >= self._rests_until_s:
            self.commit()

    def publish_all(self) -> None:
        """Publish every alarm as it stands, after a restart."""
        for alarm in self.registry.alarms():
            self._publish(alarm)

    def save(self) -> None:
        """Write the state to disk."""
        begun = self._now()
        stations = {
            name: StationState(
                time_ns=watch.time_ns,
                ahead_ns=watch.clock_ns(begun) - begun.wall_ns,
                seq=watch.seq,
                last_verdicts_ns={
                    pump: known.times_ns[-1] for pump, known in watch.verdicts.items() if known.times_ns
                },
                services=list(watch.gone_s),
            )
            for name, watch in self.stations.items()
        }
        self._file.save(SiteState(book=self.registry.state(), stations=stations))
        ended_s = self._now().steady_s
        self._rests_until_s = ended_s + (ended_s - begun.steady_s) / SAVING_SHARE

    def report(self) -> AlarmReport:
        """Rates, chattering and stale alarms."""
        now = self._now()
        clocks_ns = {name: watch.clock_ns(now) for name, watch in self.stations.items()}
        transitions = self._settings.chattering_transitions
        return AlarmReport(
            time=now.wall_ns,
            rates=self.registry.rates.figures(now.wall_ns),
            standing=dict(self._standing()),
            chattering=tuple(
                AlarmFigure(station=record.station, alarm=record.id, transitions=count)
                for record, count in self.registry.chattering(clocks_ns, transitions)
            ),
            stale=tuple(
                AlarmFigure(station=record.station, alarm=record.id, raised=record.status.raised_ns)
                for record in self.registry.stale(clocks_ns)
            ),
        )

    def figures(self) -> dict[str, float]:
        """Health figures."""
        report = self.report()
        return {name: float(count) for name, count in self._counts.items()} | {
            **report.rates,
            "stations": float(len(self.stations) - 1),
            "standing": float(sum(record.status.is_active for record in self.registry.records.values())),
            "unacknowledged": float(report.standing.get("unacknowledged", 0) + report.standing.get("returned", 0)),
            "chattering": float(len(report.chattering)),
            "stale": float(len(report.stale)),
            "disk_errors": float(self._file.errors),
        }

    def _standing(self) -> Counter[AlarmState]:
        return Counter(record.status.state for record in self.registry.records.values())

    def _publish(self, alarm: Alarm) -> None:
        name = (alarm.station, alarm.id)
        if name not in self._publishers:
            self._publishers[name] = self._bus.publisher(alarm_key(*name), history=ALARM_HISTORY)
        self._publishers[name].put(alarm.encode())

    def _unshelve(self, record: AlarmRecord, status: AlarmStatus, now: Now) -> None:
        act = {"station": record.station, "alarm": record.id, "act": "unshelve", "by": SHELF}
        try:
            self._audit.write(now.wall_ns, **act, before=record.status.state, after=status.state)
        except RecordingError as error:  # the operator is called all the same
            log.warning("%s", error)
        self.registry.unshelve(record, status, self._clock_ns(record.station, now), now.wall_ns)

    def _write_down(self, now: Now, act: AlarmAct, **outcome: str) -> bool:
        """Whether the act is in the audit."""
        try:
            self._audit.write(now.wall_ns, **act.model_dump(mode="json", exclude={"schema_name"}), **outcome)
        except RecordingError as error:
            self._counts["audit_errors"] += 1
            log.warning("%s", error)
            return False
        return True

    def _decoded(self, kind: type[M], payload: bytes) -> M | None:
        return decoded(kind, payload, self._counts, log)

    def _named(self, station: str) -> StationWatch | None:
        """What is known of a station; None if this cannot be one."""
        if station in self.stations and station != SITE:
            return self.stations[station]
        is_name = re.fullmatch(NAME_PATTERN, station) is not None and len(station) <= 64
        if not is_name or len(self.stations) > MAX_STATIONS:
            self._counts["foreign"] += 1
            return None
        return self._watch(station)

    def _clock_ns(self, station: str, now: Now) -> int:
        return self.stations[station].clock_ns(now) if station in self.stations else now.wall_ns

    def _restore(self, state: SiteState) -> None:
        now = self._now()
        self.registry.restore(state.registry)
        for name, kept in state.stations.items():
            watch = self._watch(name)
            if kept.time_ns is not None:
                watch.clock = went_on(kept.time_ns, kept.ahead_ns, now)
            watch.seq = kept.seq
            watch.verdicts = {pump: PumpVerdicts([last_ns]) for pump, last_ns in kept.last_verdicts_ns.items()}
            watch.has_samples = kept.time_ns is not None
            watch.gone_s = dict.fromkeys(kept.services, now.steady_s)  # missed until seen

    def _watch(self, station: str) -> StationWatch:
        if station not in self.stations:
            now_s = self._now().steady_s
            self.stations[station] = StationWatch(station, missed_s=now_s, start_s=now_s)
        return self.stations[station]


def limits_of(settings: AlarmSettings, station: Station | None) -> Limits:
    """Levels that are too high, from the settings and the station file if there is one."""
    high_m, overflow_m = settings.high_level_m, None
    if station is not None:
        if high_m is None and station.control.start_levels_m:
            high_m = station.control.start_levels_m[-1] + settings.high_level_margin_m
        if station.sump.overflow_level_m is not None:
            overflow_m = station.sump.overflow_level_m - settings.overflow_margin_m
            high_m = overflow_m if high_m is None else min(high_m, overflow_m)
    return Limits(high_m, overflow_m, settings.level_deadband_m)
