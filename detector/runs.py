"""Pump runs: from start to stop, the steady part cut into segments."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wetwell.detector.gate import Frame
from wetwell.detector.nominal import Nominal
from wetwell.detector.residuals import level_residuals
from wetwell.protocols.stamps import NS_PER_S

Floats = npt.NDArray[np.float64]

SEGMENT_SAMPLES = 25
WARM_UP_S = 30.0
NEAR_NOMINAL = 0.02
MAX_RUN_S = 1800.0
BREAK_S = 60.0
RUNNING_SHARE = 0.05
"""Share of the run-out flow, or of the nominal frequency, above which a pump that does not say so is running."""

SIGNALS = ("frequency_hz", "flow_m3h", "head_m", "level_m")
NEEDED = frozenset({"frequency_hz", "flow_m3h", "head_m"})
"""Without these a pump cannot be told from the system."""
BLIND_S = 60.0
"""A run that has lacked one of them for so long is reported at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """The steady samples of one run of one pump, or of a part of a long one.

    Attributes
    ----------
    pump : int
        From 0.
    window_ns : (first, last) stamp of the run
    time_s, flow_m3h, head_m, speed_ratio, total_flow_m3h : (n,) arrays
        Steady samples that have flow, head and frequency; time since the start of the run.
    segments : (m, 2) array
        Means of the level residuals (r_p, r_s) over 25 samples each. [m]
    missing : frozenset of str
        Signals that no sample of the run had.
    """

    pump: int
    window_ns: tuple[int, int]
    time_s: Floats
    flow_m3h: Floats
    head_m: Floats
    speed_ratio: Floats
    total_flow_m3h: Floats
    segments: Floats
    missing: frozenset[str]


@dataclass(slots=True)
class _Open:
    """A run that goes on."""

    start_ns: int
    part_ns: int
    last_ns: int
    steady_from_ns: int
    rows: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)
    is_steady: bool = False
    is_reported_blind: bool = False


class RunTracker:
    """Cuts the frames of a station into pump runs.

    A sample is steady when its pump runs near nominal frequency, `WARM_UP_S` after its start and after any other
    pump has started or stopped. A run ends when the pump stops, when the stream breaks for more than `BREAK_S`, or in
    parts of `MAX_RUN_S`, so that a pump that never stops is judged too.

    Memory: at most `MAX_RUN_S` samples a pump.
    """

    def __init__(self, nominal: Nominal) -> None:
        self._nominal = nominal
        self._pumps = range(nominal.pumps)
        self._open: list[_Open | None] = [None] * nominal.pumps
        self._running: tuple[bool, ...] = (False,) * nominal.pumps

    def update(self, frame: Frame) -> list[Run]:
        """Runs that this frame ends."""
        ended = self.finish() if frame.gap_s > BREAK_S else []
        running = tuple([self._is_running(frame, pump) for pump in self._pumps])
        if running != self._running:
            self._running = running
            steady_from_ns = frame.time_ns + int(WARM_UP_S * NS_PER_S)
            for going_on in self._open:
                if going_on is not None:
                    going_on.steady_from_ns = steady_from_ns
        for pump in self._pumps:
            if self._running[pump] or self._open[pump] is not None:
                finished = self._update_pump(pump, frame)
                if finished is not None:
                    ended.append(finished)
        return ended

    def finish(self) -> list[Run]:
        """Runs that are still open, at the end of a recording."""
        return [run for pump in self._pumps if (run := self._close(pump)) is not None]

    def steady_samples(self) -> list[tuple[int, float, float, float, float]]:
        """(pump, flow, head, speed ratio, total flow) of each pump that was steady in the last frame."""
        return [(pump, *run.rows[-1][1:]) for pump, run in enumerate(self._open) if run is not None and run.is_steady]

    def newly_blind_runs(self) -> list[Run]:
        """Open runs that have lacked a needed signal since their start, `BLIND_S` ago; each is given once."""
        blind = []
        for pump, run in enumerate(self._open):
            if run is None or run.is_reported_blind or run.last_ns - run.start_ns < BLIND_S * NS_PER_S:
                continue
            run.is_reported_blind = True
            if not run.seen >= NEEDED:
                blind.append(self._as_run(pump, run))
        return blind

    def last_segments(self, pump: int, segments: int) -> Run | None:
        """The last segments of an open run, when it has just filled one and has at least so many."""
        run = self._open[pump]
        samples = segments * SEGMENT_SAMPLES
        if run is None or len(run.rows) < samples or len(run.rows) % SEGMENT_SAMPLES:
            return None
        return self._as_run(pump, run, len(run.rows) - samples)

    def _is_running(self, frame: Frame, pump: int) -> bool:
        reading = frame.pumps[pump]
        if reading.running is not None:
            return reading.running
        if not math.isnan(reading.frequency_hz):
            return reading.frequency_hz > RUNNING_SHARE * self._nominal.frequencies_hz[pump]
        if not math.isnan(reading.flow_m3h):
            return reading.flow_m3h > RUNNING_SHARE * self._nominal.runout_flow_m3h(pump)
        return self._open[pump] is not None

    def _update_pump(self, pump: int, frame: Frame) -> Run | None:
        run = self._open[pump]
        if not self._running[pump]:
            return self._close(pump)
        if run is None:
            steady_from_ns = frame.time_ns + int(WARM_UP_S * NS_PER_S)
            run = self._open[pump] = _Open(frame.time_ns, frame.time_ns, frame.time_ns, steady_from_ns)
        finished = None
        if frame.time_ns - run.part_ns >= MAX_RUN_S * NS_PER_S:
            finished = self._as_run(pump, run)
            run.part_ns = frame.time_ns
            run.rows.clear()
            run.seen.clear()
        run.last_ns = frame.time_ns
        self._collect(run, pump, frame)
        return finished

    def _collect(self, run: _Open, pump: int, frame: Frame) -> None:
        run.is_steady = False
        reading = frame.pumps[pump]
        values = (reading.frequency_hz, reading.flow_m3h, reading.head_m, frame.level_m)
        run.seen.update(name for name, value in zip(SIGNALS, values, strict=True) if not math.isnan(value))
        speed_ratio = reading.frequency_hz / self._nominal.frequencies_hz[pump]
        is_usable = abs(speed_ratio - 1.0) <= NEAR_NOMINAL and not math.isnan(reading.flow_m3h + reading.head_m)
        if frame.time_ns < run.steady_from_ns or not is_usable:
            return
        total_m3h = reading.flow_m3h
        if self._nominal.is_common_header:
            total_m3h = sum(other.flow_m3h for other, on in zip(frame.pumps, self._running, strict=True) if on)
            if math.isnan(total_m3h):
                return
        time_s = (frame.time_ns - run.part_ns) / NS_PER_S
        run.is_steady = True
        run.rows.append((time_s, reading.flow_m3h, reading.head_m, speed_ratio, total_m3h))

    def _close(self, pump: int) -> Run | None:
        run = self._open[pump]
        self._open[pump] = None
        return None if run is None else self._as_run(pump, run)

    def _as_run(self, pump: int, run: _Open, first_row: int = 0) -> Run:
        """The run from a row on; where that is not the first, its window begins there."""
        rows = np.array(run.rows[first_row:]).reshape(-1, 5)
        time_s, flow_m3h, head_m, speed_ratio, total_m3h = rows.T
        pump_m, system_m = level_residuals(
            flow_m3h,
            head_m,
            speed_ratio,
            curve=self._nominal.curves[pump],
            static_head_m=self._nominal.static_head_m,
            friction_h2_m5=self._nominal.friction_h2_m5,
            total_flow_m3h=total_m3h,
        )
        whole = len(rows) // SEGMENT_SAMPLES * SEGMENT_SAMPLES
        residuals = np.column_stack([pump_m, system_m])[:whole]
        return Run(
            pump=pump,
            window_ns=(run.part_ns + round(time_s[0] * NS_PER_S) if first_row else run.part_ns, run.last_ns),
            time_s=time_s,
            flow_m3h=flow_m3h,
            head_m=head_m,
            speed_ratio=speed_ratio,
            total_flow_m3h=total_m3h,
            segments=residuals.reshape(-1, SEGMENT_SAMPLES, 2).mean(axis=1) if whole else np.empty((0, 2)),
            missing=frozenset(SIGNALS) - run.seen,
        )
