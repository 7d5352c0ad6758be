"""Pump runs: from start to stop, the steady part cut into segments."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wetwell.detector.gate import Frame, PumpFrame
from wetwell.detector.nominal import Nominal
from wetwell.detector.residuals import level_residuals
from wetwell.protocols.stamps import NS_PER_S

Floats = npt.NDArray[np.float64]

SEGMENT_SAMPLES = 25
SEGMENT_S = 25.0
"""A feed slower than one sample a second has fewer samples in a segment, but one at least."""
WARM_UP_S = 30.0
SETTLING_S = 10.0
SPEED_STEP = 0.02
"""A change of the speed by more than this share of nominal has to settle."""
MIN_SPEED_RATIO = 0.4
MAX_SPEED_RATIO = 1.25
MAX_RUN_S = 1800.0
BREAK_S = 60.0
USUAL_GAPS = 2.5
"""A feed that is slow by itself breaks only where it lacks more than so many of its usual steps."""
RUNNING_SHARE = 0.05
"""Share of the run-out flow, or of the nominal frequency, above which a pump that does not say so is running."""
NO_FLOW_SHARE = 0.01
"""Share of the run-out flow below which the check valve is closed: then the main may take less than its curve."""

SIGNALS = ("frequency_hz", "flow_m3h", "head_m", "level_m", "power_kw")
NEEDED = frozenset({"frequency_hz", "flow_m3h", "head_m"})
"""Without these a pump cannot be told from the system."""
COLUMNS = 9
BLIND_S = 60.0
"""A run that has lacked one of them for so long is reported at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segments:
    """Means over steady samples, m of them: 25 samples each, or what a slow feed has in `SEGMENT_S`.

    Attributes
    ----------
    residual_m : (m, 2) array
        Level residuals (r_p, r_s). [m]
    flow_m3h, total_m3h : (m,) arrays
        Q/N of the pump and flow of the main, as measured. [m³/h]
    duty_m3h, duty_total_m3h : (m,) arrays
        The same by the datasheet, for the pumps that run and their speeds: free of the noise of the meters. [m³/h]
    level_m : (m,) array
        NaN where the level is not known. [m]
    speed_ratio : (m,) array
    samples : int
        In each segment.
    """

    residual_m: Floats
    flow_m3h: Floats
    total_m3h: Floats
    duty_m3h: Floats
    duty_total_m3h: Floats
    level_m: Floats
    speed_ratio: Floats
    samples: int = SEGMENT_SAMPLES

    def __len__(self) -> int:
        return len(self.flow_m3h)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """The steady samples of one run of one pump, or of a part of a long one.

    Attributes
    ----------
    pump : int
        From 0.
    window_ns : (first, last) stamp of the run
    time_s, flow_m3h, head_m, speed_ratio, total_flow_m3h, level_m, power_kw : (n,) arrays
        Steady samples that have flow, head and frequency; time since the start of the run. Level, power may be NaN.
    segments : Segments
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
    level_m: Floats
    power_kw: Floats
    segments: Segments
    missing: frozenset[str]


@dataclass(slots=True)
class OpenRun:
    """A run that goes on."""

    start_ns: int
    part_ns: int
    last_ns: int
    steady_from_ns: int
    speed_ratio: float = math.nan
    rows: list[tuple[float, ...]] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)
    is_steady: bool = False
    is_reported_blind: bool = False


class RunTracker:
    """Cuts the frames of a station into pump runs.

    A sample is steady `WARM_UP_S` after its pump has started and after any other pump has started or stopped, and
    `SETTLING_S` after the last change of its speed. A run ends when the pump stops, when the stream breaks for more
    than `BREAK_S` and its own pace explain, or in parts of `MAX_RUN_S`, so that one that never stops is judged too.

    Memory: at most `MAX_RUN_S` samples a pump.
    """

    def __init__(self, nominal: Nominal) -> None:
        self._nominal = nominal
        self._open: list[OpenRun | None] = [None] * nominal.pumps
        self._running: tuple[bool, ...] = (False,) * nominal.pumps
        self._segment_samples = SEGMENT_SAMPLES
        self._last_gaps_s = (0.0, 0.0)
        self._duty_speeds: tuple[float, ...] = ()
        self._duty_m3h: list[float] = []

    @property
    def running(self) -> tuple[bool, ...]:
        """Which pumps ran in the last frame."""
        return self._running

    def update(self, frame: Frame) -> list[Run]:
        """Runs that this frame ends."""
        is_break = frame.gap_s > BREAK_S and frame.gap_s > USUAL_GAPS * min(self._last_gaps_s)
        self._last_gaps_s = (self._last_gaps_s[1], frame.gap_s)
        ended = self.finish() if is_break else []
        running = tuple(
            [
                self._is_running(reading, pump) if reading.running is None else reading.running
                for pump, reading in enumerate(frame.pumps)
            ]
        )
        if running != self._running:
            self._running = running
            for going_on in self._open:
                if going_on is not None:
                    _settle(going_on, frame.time_ns, WARM_UP_S)
        for pump, is_running in enumerate(running):
            if is_running or self._open[pump] is not None:
                finished = self._update_pump(pump, frame)
                if finished is not None:
                    ended.append(finished)
        return ended

    def finish(self) -> list[Run]:
        """Runs that are still open, at the end of a recording."""
        return [run for pump in range(self._nominal.pumps) if (run := self._close(pump)) is not None]

    def steady_samples(self) -> list[tuple[int, tuple[float, ...]]]:
        """Pump and (flow, head, speed ratio, total flow) of each pump that was steady in the last frame."""
        return [(pump, run.rows[-1][1:5]) for pump, run in enumerate(self._open) if run is not None and run.is_steady]

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

    def full_segments(self, pump: int) -> int:
        """Number of segments of an open run, when it has just filled one; else 0."""
        run = self._open[pump]
        if run is None or not run.is_steady or len(run.rows) % self._segment_samples:
            return 0
        return len(run.rows) // self._segment_samples

    def last_segments(self, pump: int, segments: int) -> Run:
        """The last segments of an open run, of which the window begins with them."""
        run = self._open[pump]
        if run is None:
            raise ValueError(f"pump {pump} has no open run")
        return self._as_run(pump, run, len(run.rows) - segments * self._segment_samples)

    def _is_running(self, reading: PumpFrame, pump: int) -> bool:
        """Whether a pump runs that does not say so."""
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
            run = self._open[pump] = OpenRun(frame.time_ns, frame.time_ns, frame.time_ns, 0)
            _settle(run, frame.time_ns, WARM_UP_S)
        finished = None
        if frame.time_ns - run.part_ns >= MAX_RUN_S * NS_PER_S:
            finished = self._finished(pump, run)
            run.part_ns = frame.time_ns
            run.rows.clear()
            run.seen.clear()
        run.last_ns = frame.time_ns
        self._collect(run, pump, frame)
        return finished

    def _collect(self, run: OpenRun, pump: int, frame: Frame) -> None:
        run.is_steady = False
        reading = frame.pumps[pump]
        values = (reading.frequency_hz, reading.flow_m3h, reading.head_m, frame.level_m, reading.power_kw)
        if len(run.seen) < len(SIGNALS):
            run.seen.update(name for name, value in zip(SIGNALS, values, strict=True) if not math.isnan(value))
        speed_ratio = reading.frequency_hz / self._nominal.frequencies_hz[pump]
        if not abs(speed_ratio - run.speed_ratio) <= SPEED_STEP:
            run.speed_ratio = speed_ratio
            _settle(run, frame.time_ns, SETTLING_S)
        is_usable = MIN_SPEED_RATIO <= speed_ratio <= MAX_SPEED_RATIO
        if frame.time_ns < run.steady_from_ns or not is_usable or math.isnan(reading.flow_m3h + reading.head_m):
            return
        total_m3h = reading.flow_m3h
        duty_m3h = self._duty(frame)
        duty_total_m3h = duty_m3h[pump]
        if self._nominal.is_common_header:
            total_m3h = sum(other.flow_m3h for other, on in zip(frame.pumps, self._running, strict=True) if on)
            duty_total_m3h = sum(duty_m3h)
            if math.isnan(total_m3h):
                return
        time_s = (frame.time_ns - run.part_ns) / NS_PER_S
        run.is_steady = True
        row = (time_s, reading.flow_m3h, reading.head_m, speed_ratio, total_m3h, frame.level_m, reading.power_kw)
        run.rows.append((*row, duty_m3h[pump] / speed_ratio, duty_total_m3h))

    def _duty(self, frame: Frame) -> list[float]:
        """Flows by the datasheet; worked out anew only when a speed has changed."""
        frequencies_hz = self._nominal.frequencies_hz
        speeds = tuple(
            [
                reading.frequency_hz / nominal_hz if is_running and reading.frequency_hz > 0.0 else 0.0
                for reading, nominal_hz, is_running in zip(frame.pumps, frequencies_hz, self._running, strict=True)
            ]
        )
        if speeds != self._duty_speeds:
            self._duty_speeds = speeds
            self._duty_m3h = self._nominal.duty_flows(speeds)
        return self._duty_m3h

    def _close(self, pump: int) -> Run | None:
        run = self._open[pump]
        self._open[pump] = None
        return None if run is None else self._finished(pump, run)

    def _finished(self, pump: int, run: OpenRun) -> Run:
        """The whole run; its pace says how many samples a segment has from now on."""
        if len(run.rows) > 1:
            period_s = float(np.median(np.diff([row[0] for row in run.rows])))
            self._segment_samples = min(SEGMENT_SAMPLES, max(1, round(SEGMENT_S / period_s)))
        return self._as_run(pump, run)

    def _as_run(self, pump: int, run: OpenRun, first_row: int = 0) -> Run:
        """The run from a row on; where that is not the first, its window begins there."""
        rows = np.array(run.rows[first_row:]).reshape(-1, COLUMNS)
        time_s, flow_m3h, head_m, speed_ratio, total_m3h, level_m, power_kw, duty_m3h, duty_total_m3h = rows.T
        pump_m, system_m = level_residuals(
            flow_m3h,
            head_m,
            speed_ratio,
            curve=self._nominal.curves[pump],
            static_head_m=self._nominal.static_head_m,
            friction_h2_m5=self._nominal.friction_h2_m5,
            total_flow_m3h=total_m3h,
        )
        is_closed = (total_m3h < NO_FLOW_SHARE * self._nominal.runout_flow_m3h(pump)) & (system_m < 0.0)
        columns = np.column_stack(
            [
                pump_m,
                np.where(is_closed, 0.0, system_m),
                flow_m3h / speed_ratio,
                total_m3h,
                duty_m3h,
                duty_total_m3h,
                level_m,
                speed_ratio,
            ]
        )
        whole = len(rows) // self._segment_samples * self._segment_samples
        means = columns[:whole].reshape(-1, self._segment_samples, columns.shape[1]).mean(axis=1)
        by_column = np.ascontiguousarray(means.T)
        return Run(
            pump=pump,
            window_ns=(run.part_ns + round(time_s[0] * NS_PER_S) if first_row else run.part_ns, run.last_ns),
            time_s=time_s,
            flow_m3h=flow_m3h,
            head_m=head_m,
            speed_ratio=speed_ratio,
            total_flow_m3h=total_m3h,
            level_m=level_m,
            power_kw=power_kw,
            segments=Segments(
                residual_m=np.ascontiguousarray(means[:, :2]),
                flow_m3h=by_column[2],
                total_m3h=by_column[3],
                duty_m3h=by_column[4],
                duty_total_m3h=by_column[5],
                level_m=by_column[6],
                speed_ratio=by_column[7],
                samples=self._segment_samples,
            ),
            missing=frozenset(SIGNALS) - run.seen,
        )


def _settle(run: OpenRun, now_ns: int, seconds: float) -> None:
    run.steady_from_ns = max(run.steady_from_ns, now_ns + int(seconds * NS_PER_S))
