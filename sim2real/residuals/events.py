"""Residuals of the controller: the level at which it starts and stops pumps, against its thresholds."""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy.special import ndtr

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import LEVEL
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.regimes import START_RAMP, Event, Regimes
from wetwell.sim2real.recording.traces import BETWEEN, Traces
from wetwell.sim2real.replay.level_noise import level_noise_m, told_noise_m
from wetwell.sim2real.replay.observer import Observer
from wetwell.sim2real.replay.replay import Prediction
from wetwell.sim2real.replay.steps import between_steps_m
from wetwell.sim2real.residuals.bins import NO_PUMP, START_LEVEL, STOP_LEVEL, Bins
from wetwell.sim2real.residuals.signals import QUANTUM_SHARE
from wetwell.sim2real.residuals.telemetry import Pattern
from wetwell.simulator.telemetry.channels import channels_of

WINDOW_S = 30
MIN_LEVELS = 8
SCAN_S = 1.0
NEVER_S = 10**6
"""Since the event before the first one."""
WAITING_S = 2.0
"""Scans that a timer may take beside its delay."""
TOLERANCE_M = 0.002
EVENT_FLOOR = 0.5


@dataclass(frozen=True, kw_only=True)
class Stretches:
    """Straight stretches of the level before each event, to be read at other times than they were recorded.

    `counted` are the seconds of each, (events, `WINDOW_S`), and `is_counted` which of them count; `level_m` is (n,).
    """

    second: Integers
    counted: Integers
    is_counted: Flags
    level_m: Floats

    def lines(self, shift_s: float = 0.0) -> tuple[Floats, Floats]:
        """(events,) level and slope at each event for a level that was recorded `shift_s` late. [m, m/s].

        Where too few values are left the line of the unshifted stretch is gone on with.
        """
        if shift_s == 0.0:
            return self._unshifted
        whole = int(np.floor(shift_s))
        share = shift_s - whole
        near = self._fitted(whole)
        far = self._fitted(whole + 1) if share > 0.0 else near
        shifted_m, shifted_m_s = ((1.0 - share) * a + share * b for a, b in zip(near, far, strict=True))
        is_known = np.isfinite(shifted_m)
        if is_known.all():
            return shifted_m, shifted_m_s
        level_m, slope_m_s = self._unshifted
        level_m = np.where(is_known, shifted_m, level_m + slope_m_s * shift_s)
        return level_m, np.where(is_known, shifted_m_s, slope_m_s)

    @cached_property
    def _unshifted(self) -> tuple[Floats, Floats]:
        return self._fitted(0)

    def _fitted(self, later_s: int) -> tuple[Floats, Floats]:
        place = self.counted + later_s
        values_m = self.level_m[np.clip(place, 0, self.level_m.size - 1)]
        is_known = self.is_counted & (place >= 0) & (place < self.level_m.size) & np.isfinite(values_m)
        count = is_known.sum(axis=1)
        enough = np.where(count >= MIN_LEVELS, count, np.nan)  # NaN is "no line"
        time_s, values_m = (
            np.where(is_known, self.counted - self.second[:, None], 0),
            np.where(is_known, values_m, 0.0),
        )
        middle_s, middle_m = time_s.sum(axis=1) / enough, values_m.sum(axis=1) / enough
        about_s = np.where(is_known, time_s - middle_s[:, None], 0.0)
        slope_m_s = (about_s * values_m).sum(axis=1) / enough / ((about_s**2).sum(axis=1) / enough)
        return middle_m - slope_m_s * middle_s, slope_m_s


@dataclass(frozen=True, slots=True, kw_only=True)
class EventResiduals:
    """Residuals at starts and stops, (events,) each; `number` is that of the threshold, from 0.

    `since_s` is the time since the event before. Where the level is known when it passes from step to step, it may be
    off by `half_step_m`: nobody says whether it is rounded or cut off.
    """

    bins: Bins
    number: Integers
    since_s: Integers
    stretches: Stretches
    noise_m: float
    pattern: Pattern | None
    half_step_m: float = 0.0

    def of(self, prediction: Prediction) -> Floats:
        """(events,) level that the controller saw, minus its threshold, over the standard deviation.

        A late level shows afterwards what the controller saw; under a late frequency the event was before its record.
        Whether the timers of a late controller run side by side or one after the other is open: an event that follows
        another within the delay may find the level past its threshold.
        """
        plant = prediction.plant
        frequency = channels_of("frequency_hz", len(plant.pumps))[0]
        level_m, slope_m_s = self.stretches.lines(plant.sensors[LEVEL].delay_s - plant.sensors[frequency].delay_s)
        is_start = self.bins.signal == START_LEVEL
        early_m = self.noise_m * _earliness(np.abs(slope_m_s) / self.noise_m)
        level_m = level_m + np.where(is_start, 1.0, -1.0) * (0.7 * early_m - 0.5 * SCAN_S * np.abs(slope_m_s))
        seen_m = level_m - slope_m_s * plant.control_delay_s
        wanted_m = np.where(is_start, plant.start_levels_m[self.number], plant.stop_levels_m[self.number])
        error_m = seen_m - wanted_m
        if plant.control_delay_s > 0.0:
            is_past = np.where(is_start, error_m > 0.0, error_m < 0.0)
            error_m[is_past & (self.since_s <= plant.control_delay_s + WAITING_S)] = 0.0
        if self.pattern is not None:
            held_m = min(plant.sensors[LEVEL].deadband, self.pattern.deadband)
            rounded_m = QUANTUM_SHARE * self.pattern.rounding(plant.sensors[LEVEL].quantum)
            error_m = np.sign(error_m) * np.maximum(np.abs(error_m) - held_m - rounded_m, 0.0)
        may_be = [error_m + shift_m for shift_m in (0.0, self.half_step_m, -self.half_step_m)]
        error_m = min(may_be, key=lambda one: float(np.abs(one).sum()))
        return np.asarray(error_m / self.bins.deviation, dtype=np.float64)


def event_residuals(
    traces: Traces, station: Station, regimes: Regimes, observer: Observer, pattern: Pattern | None
) -> EventResiduals:
    """Of every start and stop that follows a straight stretch of the level that an observer follows."""
    noise_m, level_m, half_step_m = level_noise_m(traces, station), traces.level_m, 0.0
    if observer.is_of_steps:
        noise_m, level_m = told_noise_m(traces, station, observer.level_m), between_steps_m(observer.level_m)
        half_step_m = 0.0 if pattern is None or pattern.is_usual else 0.5 * pattern.quantum
        pattern = None
    events: list[Event] = []
    waited_s: list[int] = []
    calm: list[Flags] = []
    last = -NEVER_S
    ahead = np.arange(1 - WINDOW_S, 1)
    for event in regimes.events:
        window = event.second + ahead
        is_calm = (window > last) & (regimes.of_station[window] != START_RAMP)
        since_s = event.second - last
        last = event.second
        if (
            window[0] >= 0
            and _is_of_controller(traces, window[0], event.second + 2)
            and 1 <= event.number <= len(station.control.start_levels_m)
        ):
            events.append(event)
            waited_s.append(since_s)
            calm.append(is_calm)
    second = np.array([event.second for event in events], dtype=np.int64)
    counted, is_counted = second[:, None] + ahead, np.array(calm, dtype=np.bool_).reshape(-1, WINDOW_S)
    stretches = Stretches(second=second, counted=counted, is_counted=is_counted, level_m=level_m)
    sign = np.array([1.0 if event.is_start else -1.0 for event in events])
    kept = stretches.lines()[1] * sign > 0.0
    second, sign = second[kept], sign[kept]
    stretches = Stretches(second=second, counted=counted[kept], is_counted=is_counted[kept], level_m=level_m)
    slope_m_s = stretches.lines()[1]
    early_m = noise_m * _earliness(np.abs(slope_m_s) / noise_m)
    deviation = np.sqrt((SCAN_S * slope_m_s) ** 2 + early_m**2 + noise_m**2 + TOLERANCE_M**2)
    return EventResiduals(
        bins=Bins(
            signal=np.where(sign > 0, START_LEVEL, STOP_LEVEL),
            regime=regimes.of_station[second],
            cycle=regimes.cycle[second],
            pump=np.full(second.size, NO_PUMP),
            second=second,
            deviation=deviation,
            floor=np.full(second.size, EVENT_FLOOR),
            tolerance=np.hypot(0.5 * SCAN_S * slope_m_s, 0.5 * noise_m) / deviation,
            material=np.hypot(station.materiality.threshold_m, SCAN_S * slope_m_s) / deviation,
        ),
        number=np.array([event.number - 1 for event in events], dtype=np.int64)[kept],
        since_s=np.array(waited_s, dtype=np.int64)[kept],
        stretches=stretches,
        noise_m=noise_m,
        pattern=pattern,
        half_step_m=half_step_m,
    )


def _is_of_controller(traces: Traces, begin: int, end: int) -> bool:
    """Whether nobody else commanded the pumps meanwhile, and no recording ended."""
    return not (traces.by_hand.is_commanding[begin:end].any() or np.any(traces.part[begin:end] == BETWEEN))


def _earliness(slope_ratio: Floats) -> Floats:
    """(events,) how far before its threshold a level with noise crosses it, in standard deviations of the noise."""
    return np.asarray(np.interp(slope_ratio, *_earliness_table()), dtype=np.float64)


@cache
def _earliness_table() -> tuple[Floats, Floats]:
    ratios = np.r_[0.0, np.geomspace(1e-3, 10.0, 100)]
    return ratios, np.array([_earliness_at(float(ratio)) for ratio in ratios])


def _earliness_at(slope_ratio: float) -> float:
    r"""How far before its threshold a level with noise is taken to cross it, in standard deviations of the noise.

    The m at which the expected number of crossings before reaches ln 2, $\sum_{k \ge 0} \Phi(-m - k s) = \ln 2$.
    """
    steps = np.arange(min(int(6.0 / max(slope_ratio, 1e-3)), 6000) + 1) * slope_ratio
    low, high = -1.0, 5.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        if ndtr(-middle - steps).sum() > np.log(2.0):
            low = middle
        else:
            high = middle
    return max(0.5 * (low + high), 0.0)
