"""What the page knows of one station, and what is new since it was last sent."""

import json
from collections import deque
from collections.abc import Mapping
from typing import Any

from wetwell.protocols.messages.alarm import STATION, Alarm, AlarmState
from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.protocols.messages.model import Model
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.dashboard.view.cause import Cause, states_of, worst_cause
from wetwell.services.dashboard.view.sample_row import NS_PER_MS, live_figures, number, sample_row, thinned

ROWS_A_FRAME = 8
"""Most samples for each frame since the last with some: a station that runs faster than life is drawn in steps."""
VERDICTS = 60
"""Verdicts that are kept of each pump."""
HOUR_S = 3600.0
LONGEST_PAUSE_S = HOUR_S
"""Over a longer pause between two samples no energy is counted. [s]"""
SIMULATOR = "simulator"
LATE_SAMPLES = 120
"""So many samples in a row that are older than the last one are no stragglers: the source has begun anew."""

WAITING: frozenset[AlarmState] = frozenset({"unacknowledged", "returned", "latched_unacknowledged"})
"""States of an alarm that wait for an acknowledgement."""
RANKS: dict[str, int] = {
    "pump_and_system_fault": 7,
    "pump_fault": 6,
    "system_fault": 6,
    "sensor_fault": 5,
    "no_data": 4,
    "unknown": 3,
    "learning": 2,
    "normal": 1,
}
"""States by how much they ask for attention."""


class StationView:
    """State of one station for its page and for its line in the overview.

    Parameters
    ----------
    name : str
    index : int
        Its place in the overview's messages.
    rows : int
        Samples that are kept for charts.
    """

    def __init__(self, name: str, index: int, rows: int) -> None:
        self.name = name
        self.index = index
        self.sample: Sample | None = None
        self.first_ns = 0
        self.seen_s = 0.0
        self.now_s = 0.0
        self.is_stale = True
        self.lost = 0
        self._rows: deque[str] = deque(maxlen=rows)
        self._late = 0
        self._begins = False
        self._framed: int | None = None
        self._fresh_samples: list[Sample] = []
        self._fresh: dict[str, Any] = {}
        self._model: str | None = None
        self._gap: GapWatch | None = None
        self._levels: tuple[float, ...] = ()
        self._floor_m = 0.0
        self._names: list[str | None] = []
        self._verdicts: dict[int, deque[str]] = {}
        self._last_verdicts: dict[int, Verdict] = {}
        self._states: Mapping[int, State] = {}
        self._cause: Cause | None = None
        self._alarms: dict[str, Alarm] = {}
        self._statuses: dict[str, str] = {}
        self._alive: set[str] = set()
        self._site: list[str] = []
        self._is_held = False
        self.energy_kwh: dict[int, float] = {}

    @property
    def kept_rows(self) -> int | None:
        """How many samples are kept."""
        return self._rows.maxlen

    @kept_rows.setter
    def kept_rows(self, rows: int) -> None:
        self._rows = deque(self._rows, maxlen=rows)

    def is_last(self, sample: Sample) -> bool:
        """Whether this is the last sample once more."""
        return self.sample is not None and (sample.time, sample.seq) == (self.sample.time, self.sample.seq)

    def handle_sample(self, sample: Sample, now_s: float, passed_over: int = 0) -> bool:
        """Take a sample that is not older than the last; whether it was one. Before it others were passed over."""
        self.seen_s = now_s
        if self.sample is not None and sample.time <= self.sample.time:
            self._late += 1
            if self._late < LATE_SAMPLES:
                return False
            self._rows.clear()
            self._fresh_samples.clear()
            self._begins = True
            self.first_ns = sample.time
        elif self.sample is None:
            self.first_ns = sample.time
        else:
            self.lost += max(0, sample.seq - self.sample.seq - 1 - passed_over)
        self._late = 0
        self._add_energy(sample)
        self.sample = sample
        self._fresh_samples.append(sample)
        return True

    def _add_energy(self, sample: Sample) -> None:
        """Add the energy since the last sample, by the mean of both powers."""
        if self.sample is None:
            return
        span_s = (sample.time - self.sample.time) / NS_PER_S
        if not 0.0 < span_s <= LONGEST_PAUSE_S:
            return
        for pump, (before, now) in enumerate(zip(self.sample.pumps, sample.pumps, strict=False), start=1):
            if before.power_kw is not None and now.power_kw is not None:
                energy_kwh = 0.5 * (before.power_kw + now.power_kw) * span_s / HOUR_S
                self.energy_kwh[pump] = self.energy_kwh.get(pump, 0.0) + max(energy_kwh, 0.0)

    @property
    def is_good(self) -> bool:
        """Whether samples come, and their source calls them good."""
        return not self.is_stale and self.sample is not None and self.sample.quality == "good"

    @property
    def room(self) -> int:
        """How many samples fit before those that were heard."""
        return (self._rows.maxlen or 0) - len(self._rows)

    def prepend(self, rows: list[str], first_ns: int) -> bool:
        """Take rows from before `first_ns` as far as there is room; whether that still is the first sample."""
        if first_ns != self.first_ns:
            return False
        self._rows.extendleft(reversed(rows[max(0, len(rows) - self.room) :]))
        return True

    def handle_verdict(self, verdict: Verdict) -> None:
        """Take a verdict; one that came before is left out."""
        text = verdict.encode().decode()
        kept = self._verdicts.setdefault(verdict.pump, deque(maxlen=VERDICTS))
        if text in kept:
            return
        kept.append(text)
        self._last_verdicts[verdict.pump] = verdict
        self._states = states_of(self._last_verdicts.values())
        self._cause = worst_cause(self._last_verdicts.values())
        self._fresh.setdefault("verdicts", []).append(text)

    def handle_model(self, model: Model) -> None:
        """Take the curves."""
        self._model = model.encode().decode()
        self._levels = model.start_levels_m
        self._floor_m = model.floor_level_m
        self._names = [pump.name for pump in model.pumps]
        self._fresh["model"] = self._model

    def handle_alarm(self, alarm: Alarm) -> None:
        """Take the last state of an alarm."""
        self._alarms[alarm.id] = alarm
        self._fresh.setdefault("alarms", {})[alarm.id] = alarm.encode().decode()

    def handle_gap(self, gap: GapWatch) -> None:
        """Take the gap to the simulator."""
        self._gap = gap
        self._fresh["gap"] = gap.encode().decode()

    def handle_status(self, status: Status) -> None:
        """Take the health figures of a service; those of a simulator say whether its plant is held."""
        self._statuses[status.service] = status.encode().decode()
        if status.service == SIMULATOR:
            self._is_held = status.figures.get("held", 0.0) > 0.0
        self._fresh.setdefault("statuses", {})[status.service] = self._statuses[status.service]

    def handle_presence(self, service: str, *, is_alive: bool) -> None:
        """Take that a service has come or gone."""
        (self._alive.add if is_alive else self._alive.discard)(service)
        self._fresh["alive"] = True

    def handle_site(self, services: list[str]) -> None:
        """Take which services of the whole site live."""
        self._site = services
        self._fresh["alive"] = True

    @property
    def is_known(self) -> bool:
        """Whether anything but its name was ever heard of it."""
        known = (self._last_verdicts, self._model, self._gap, self._alarms, self._statuses, self._alive)
        return self.sample is not None or any(known)

    def settle(self, now_s: float, stale_s: float) -> bool:
        """Notice that samples have stopped or come again; whether either has happened."""
        if self._is_held and SIMULATOR in self._alive:
            self.seen_s = now_s  # nothing is missed of a plant that stands
        is_stale = self.sample is None or now_s - self.seen_s > stale_s
        if is_stale == self.is_stale:
            return False
        self.is_stale = is_stale
        self._fresh["stale"] = True
        return True

    def frame(self, count: int) -> str | None:
        """JSON of what is new since the last frame, without the closing brace's `id`; None if nothing is.

        Parameters
        ----------
        count : int
            Number of the frame; frames without news are counted too, so that gathered samples have the room of single
            ones.
        """
        rows = [sample_row(sample) for sample in thinned(self._fresh_samples, self._most_rows(count))]
        if rows:
            self._framed = count
        fresh, self._fresh, self._fresh_samples = self._fresh, {}, []
        self._rows.extend(rows)
        begins, self._begins = self._begins, False
        if not rows and not fresh:
            return None
        parts = self._live(rows)
        if begins:
            parts.append('"begins":true')
        if "verdicts" in fresh:
            parts.append(f'"verdicts":[{",".join(fresh["verdicts"])}]')
        for name in ("model", "gap"):
            if name in fresh:
                parts.append(f'"{name}":{fresh[name]}')
        for name in ("alarms", "statuses"):
            if name in fresh:
                parts.append(f'"{name}":[{",".join(fresh[name].values())}]')
        if "alive" in fresh:
            parts.append(self._presence())
        return ",".join(parts)

    def _most_rows(self, count: int) -> int:
        kept = self._rows.maxlen or 0
        return kept if self._framed is None else min((count - self._framed) * ROWS_A_FRAME, kept)

    def state(self) -> str:
        """JSON of all that is known, in the form of a frame."""
        verdicts = [text for kept in self._verdicts.values() for text in kept]
        alarms = [alarm.encode().decode() for alarm in self._alarms.values()]
        parts = [
            *self._live(list(self._rows)),
            '"begins":true',
            f'"verdicts":[{",".join(verdicts)}]',
            f'"alarms":[{",".join(alarms)}]',
            f'"statuses":[{",".join(self._statuses.values())}]',
            self._presence(),
        ]
        if self._model is not None:
            parts.append(f'"model":{self._model}')
        if self._gap is not None:
            parts.append(f'"gap":{self._gap.encode().decode()}')
        return ",".join(parts)

    def summary(self) -> dict[str, Any]:
        """What the overview shows of the station beside its live figures."""
        pumps = len(self.sample.pumps) if self.sample is not None else max(self._last_verdicts, default=0)
        active = [alarm for alarm in self._alarms.values() if alarm.state != "normal"]
        return {
            "name": self.name,
            "state": self.worst_state,
            "pumps": [self._states.get(pump, "unknown") for pump in range(1, pumps + 1)],
            "cause": self._cause,
            "stale": self.is_stale,
            "quality": None if self.sample is None else self.sample.quality,
            "names": self._names,
            "levels": self._levels[-1:],
            "floor": self._floor_m,
            "alarms": len(active),
            "mode": next((alarm.text for alarm in active if alarm.id == STATION), ""),
            "gap": None if self._gap is None else {"matters": self._gap.matters, "doubled": self._gap.is_doubled},
            "unacknowledged": sum(alarm.state in WAITING for alarm in active),
        }

    @property
    def last_verdicts(self) -> Mapping[int, Verdict]:
        """Last verdict on each pump, by its number."""
        return self._last_verdicts

    @property
    def alarms(self) -> list[Alarm]:
        """Alarms that are not back to normal."""
        return [alarm for alarm in self._alarms.values() if alarm.state != "normal"]

    @property
    def worst_state(self) -> str:
        """State of its worst pump; `no_data` while no samples come, whatever was said before."""
        if self.is_stale:
            return "no_data"
        return max(self._states.values(), key=lambda state: RANKS[state], default="unknown")

    def live(self) -> str:
        """JSON array of place, time in ms, level, flow, power and running pumps."""
        if self.sample is None:
            return f"[{self.index},null,null,null,null,[]]"
        return f"[{self.index},{self.sample.time // NS_PER_MS},{live_figures(self.sample)}]"

    def _presence(self) -> str:
        return f'"alive":{json.dumps(sorted(self._alive))},"site":{json.dumps(self._site)}'

    def _live(self, rows: list[str]) -> list[str]:
        sample = self.sample
        running = [] if sample is None else [pump.running for pump in sample.pumps]
        quality = None if sample is None else sample.quality
        return [
            f'"rows":[{",".join(rows)}]',
            f'"running":{json.dumps(running)}',
            f'"quality":{json.dumps(quality)}',
            f'"state":"{self.worst_state}"',
            f'"stale":{json.dumps(self.is_stale)}',
            f'"age_s":{number(None if sample is None else self.now_s - self.seen_s)}',
            f'"lost":{self.lost}',
        ]
