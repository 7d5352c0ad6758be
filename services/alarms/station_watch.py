"""What is heard of one station: its clock, its samples, verdicts and services, turned into conditions of alarms."""

import math
from dataclasses import dataclass, field

from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.messages.alarm import RuleName
from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.protocols.messages.sample import LevelSample
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.alarms.record import AlarmRecord
from wetwell.services.alarms.registry import AlarmRegistry
from wetwell.services.alarms.rules import VERDICT_RULES, fault_text, rule_of, verdict_advice, verdict_text
from wetwell.services.alarms.station_clock import Now, StationClock, set_by

KNOWN_VERDICTS = 200
"""Times of verdicts of a pump that are remembered, more than a publisher keeps for late joiners."""
START_S = 30.0
"""So long after the start older verdicts are those that publishers have kept."""
FOLLOW_VERDICTS = 3
"""So many verdicts in a row that are older than the last one mean that the clock was set back."""
FOLLOW_SAMPLES = 1_000
"""The same for samples whose `seq` is old too; more than a publisher keeps."""

STATION_SERVICES: dict[str, RuleName] = {"detector": "detector_silent"}
SITE_SERVICES: dict[str, RuleName] = {"gateway": "gateway_silent", "historian": "historian_silent"}
"""Services that are missed, of each station and of the whole site."""


@dataclass(frozen=True)
class Limits:
    """Levels that are too high. [m] None: not known."""

    high_m: float | None = None
    overflow_m: float | None = None
    deadband_m: float = 0.05


@dataclass
class PumpVerdicts:
    """Verdicts of one pump that were taken."""

    times_ns: list[int] = field(default_factory=list)
    older: int = 0

    def is_news(self, time_ns: int, *, is_start: bool, clock_ns: int | None) -> bool:
        """Whether a verdict of this time is to be taken: not one that was, nor one that came too late.

        At the start (`is_start`) older ones come from the caches of their publishers. Later a detector that went on
        from an older state tells them again; only where the clock of the station, that of its last sample, was set
        back behind the last verdict do some older ones in a row begin a new time.
        """
        if time_ns in self.times_ns:
            return False
        if self.times_ns and time_ns < self.times_ns[-1]:
            if is_start:
                self.times_ns = [time_ns, *self.times_ns][-KNOWN_VERDICTS:]
                return False
            if clock_ns is not None and clock_ns >= self.times_ns[-1]:
                return False
            self.older += 1
            if self.older < FOLLOW_VERDICTS:
                return False
        self.older = 0
        self.times_ns = [*self.times_ns, time_ns][-KNOWN_VERDICTS:]
        return True


@dataclass
class StationWatch:
    """What was last heard of a station: its clock, `seq` of its last sample, and when it and its services came."""

    name: str
    missed_s: float
    """Since when its absence counts."""
    start_s: float = 0.0
    """When the daemon began to know it."""
    clock: StationClock | None = None
    """None before the first sample."""
    seq: int = -1
    older: int = 0
    has_samples: bool = False
    is_heard: bool = False
    """Whether a sample came since its absence counts."""
    is_held: bool = False
    """Whether it is a simulated plant that stands until it is let go: then nothing of it is missed."""
    verdicts: dict[int, PumpVerdicts] = field(default_factory=dict)
    gone_s: dict[str, float | None] = field(default_factory=dict)

    @property
    def time_ns(self) -> int | None:
        """Time of the last sample."""
        return None if self.clock is None else self.clock.sample_ns

    def clock_ns(self, now: Now) -> int:
        """Time of the station; the time of day before the first sample."""
        return now.wall_ns if self.clock is None else self.clock.now_ns(now)

    def handle_sample(self, sample: LevelSample, now: Now, registry: AlarmRegistry, limits: Limits) -> bool:
        """Look at a sample; whether it was new."""
        if self.time_ns is not None and sample.time <= self.time_ns and sample.seq <= self.seq:
            self.older += 1
            if self.older < FOLLOW_SAMPLES:
                return False
        self.clock = set_by(sample.time, now) if self.clock is None else self.clock.after(sample.time, now)
        self.seq, self.older, self.missed_s = sample.seq, 0, now.steady_s
        self.has_samples = self.is_heard = True
        level_m = sample.level_m
        if level_m is not None and math.isfinite(level_m) and sample.quality != "bad":
            self._look_at_level("level_high", level_m, limits.high_m, limits.deadband_m, now, registry)
            self._look_at_level("overflow_risk", level_m, limits.overflow_m, limits.deadband_m, now, registry)
        registry.carry_on(self.name, sample.time, now.wall_ns)
        return True

    def _look_at_level(
        self,
        rule: RuleName,
        level_m: float,
        limit_m: float | None,
        deadband_m: float,
        now: Now,
        registry: AlarmRegistry,
    ) -> None:
        if limit_m is None or self.time_ns is None:
            return
        if level_m < limit_m - deadband_m and not registry.is_known(self.name, rule):
            return  # almost every sample
        least_m = limit_m - deadband_m if registry.is_wanted(self.name, rule) else limit_m
        is_there = level_m >= least_m
        text = f"{registry.rules[rule].text}: {level_m:.2f} m, limit {limit_m:.2f} m" if is_there else ""
        registry.observe(self.name, rule, is_there, self.time_ns, now.wall_ns, text=text)

    def handle_verdict(self, verdict: Verdict, now: Now, registry: AlarmRegistry) -> bool:
        """Look at a verdict; whether it was new.

        It speaks of its pump, the main of that and its meters; "unknown" of a sender that tells states alone leaves
        all as it is.
        """
        is_start = now.steady_s - self.start_s < START_S
        known = self.verdicts.setdefault(verdict.pump, PumpVerdicts())
        if not known.is_news(verdict.time, is_start=is_start, clock_ns=self.time_ns):
            return False
        faults = verdict.standing()
        if faults is None:
            return True
        for fault in faults:
            rule, pump = rule_of(fault.asset)
            is_plain = fault.severity is None
            registry.observe(
                self.name,
                rule,
                True,
                verdict.time,
                now.wall_ns,
                pump=pump,
                asset=fault.asset,
                fault=fault,
                text=verdict_text(verdict) if is_plain else fault_text(fault),
                advice=fault.advice or verdict_advice(verdict, registry.rules[rule]),
            )
        standing = {fault.asset for fault in faults}
        for record in registry.of_station(self.name):
            if _speaks_of(verdict, record) and record.asset not in standing:
                registry.observe(
                    self.name,
                    record.rule,
                    False,
                    verdict.time,
                    now.wall_ns,
                    pump=record.pump,
                    asset=record.asset,
                )
        return True

    def handle_gap(self, gap: GapWatch, now: Now, registry: AlarmRegistry) -> None:
        """Look whether the gap between the station and its simulator has doubled, and is no fault that was told."""
        names = [one.text for one in gap.called if one.since is not None and one.fault is None]
        text = (
            f"the gap that matters was {gap.first_matters:.2g} at first and is {gap.matters:.2g} times what matters "
            f"({gap.group}): {'; '.join(names) or 'not named yet'}"
        )
        registry.observe(self.name, "model_gap", gap.is_doubled, gap.time, now.wall_ns, text=text[:1000])

    @property
    def services(self) -> dict[str, RuleName]:
        """Services whose absence is an alarm here, and which."""
        return SITE_SERVICES if self.name == SITE else STATION_SERVICES

    def handle_status(self, status: Status, now: Now, registry: AlarmRegistry, heartbeat_after_s: float) -> None:
        """Look whether the gateway reaches the PLC ("waiting": it does not), and whether the PLC's program runs.

        Of a simulated plant whether it is held.
        """
        if status.service == "simulator":
            self.is_held = status.figures.get("held", 0.0) > 0.0
            return
        time_ns, age_s = self.clock_ns(now), status.figures.get("heartbeat_age_s")
        registry.observe(self.name, "plc_lost", status.state == "waiting", time_ns, now.wall_ns)
        if age_s is not None and status.state == "running":
            text = f"heartbeat of the PLC stands still for {age_s:.0f} s"
            registry.observe(self.name, "plc_stopped", age_s >= heartbeat_after_s, time_ns, now.wall_ns, text=text)

    def handle_presence(self, service: str, *, is_alive: bool, now: Now) -> None:
        """Note that a service has come or gone; a plant that has died is not held."""
        if service == "simulator" and not is_alive:
            self.is_held = False
        if service in self.services:
            gone_s = self.gone_s.get(service)
            self.gone_s[service] = None if is_alive else now.steady_s if gone_s is None else gone_s

    def look(self, now: Now, registry: AlarmRegistry, stale_after_s: float, silent_after_s: float) -> None:
        """Look for what does not come any more; a silence that is told lasts until it comes, after a restart too."""
        time_ns = self.clock_ns(now)
        if self.is_held:
            self.begin_again(now)
        if self.has_samples:
            self.gone_s.setdefault("detector", now.steady_s)
            age_s = now.steady_s - self.missed_s
            text = f"no samples for {age_s:.0f} s"
            is_stale = age_s > stale_after_s or (not self.is_heard and self._is_told("samples_stale", registry))
            registry.observe(self.name, "samples_stale", is_stale, time_ns, now.wall_ns, text=text)
        for service, gone_s in self.gone_s.items():
            rule = self.services[service]
            is_silent = gone_s is not None and (
                now.steady_s - gone_s > silent_after_s or self._is_told(rule, registry)
            )
            registry.observe(self.name, rule, is_silent, time_ns, now.wall_ns)

    def _is_told(self, rule: RuleName, registry: AlarmRegistry) -> bool:
        """Whether a silence is told already; of a plant that is held none is."""
        return not self.is_held and registry.is_wanted(self.name, rule)

    def begin_again(self, now: Now) -> None:
        """Count silence from now on: until now the bus was silent, or the plant stood."""
        self.missed_s, self.is_heard = now.steady_s, False
        self.gone_s = {service: None if gone_s is None else now.steady_s for service, gone_s in self.gone_s.items()}


def _speaks_of(verdict: Verdict, record: AlarmRecord) -> bool:
    """Whether a verdict says whether an alarm stands; those of other versions were one a pump and state."""
    if record.rule not in VERDICT_RULES:
        return False
    return record.pump == verdict.pump if record.asset is None else verdict.speaks_of(record.asset)
