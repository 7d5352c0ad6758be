"""Residuals of the controller: the level at which it starts and stops pumps, against its thresholds."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from wetwell.protocols.station import Station
from wetwell.sim2real.bins import NO_PUMP, START_LEVEL, STOP_LEVEL, Bins
from wetwell.sim2real.regimes import IDLE, STEADY, Event, Regimes
from wetwell.sim2real.replay import Prediction
from wetwell.sim2real.signal_misfit import QUANTUM_SHARE, level_noise_m
from wetwell.sim2real.telemetry_misfit import Pattern
from wetwell.sim2real.traces import Traces
from wetwell.simulator.channels import LEVEL

Floats = npt.NDArray[np.float64]

WINDOW_S = 30
MIN_POINTS = 8
SCAN_S = 1.0
TOLERANCE_M = 0.002
EVENT_FLOOR = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class EventMisfit:
    """Residuals at starts and stops, (events,) each; `number` is that of the threshold, from 0."""

    bins: Bins
    number: npt.NDArray[np.int64]
    level_m: Floats
    slope_m_s: Floats
    pattern: Pattern | None

    def residuals(self, prediction: Prediction, excused_s: int = 0) -> Floats:  # noqa: ARG002 - has no ramps
        """(events,) level that the controller saw, minus its threshold, over the standard deviation."""
        plant = prediction.plant
        late_s = float(plant.sensors.delay_s[LEVEL]) - plant.control_delay_s
        seen_m = self.level_m + self.slope_m_s * late_s
        is_start = self.bins.signal == START_LEVEL
        wanted_m = np.where(is_start, plant.start_levels_m[self.number], plant.stop_levels_m[self.number])
        error_m = seen_m - wanted_m
        if self.pattern is not None:
            held_m = min(float(plant.sensors.deadband[LEVEL]), self.pattern.deadband)
            rounded_m = QUANTUM_SHARE * min(float(plant.sensors.quantum[LEVEL]), self.pattern.quantum)
            error_m = np.sign(error_m) * np.maximum(np.abs(error_m) - held_m - rounded_m, 0.0)
        return np.asarray(error_m / self.bins.deviation, dtype=np.float64)


def event_misfit(traces: Traces, station: Station, regimes: Regimes, pattern: Pattern | None) -> EventMisfit:
    """Of every start and stop that follows a straight stretch of the level."""
    noise_m = level_noise_m(traces, station)
    rows: list[tuple[Event, float, float]] = []
    last = -WINDOW_S
    for event in regimes.events:
        begin = max(event.second - WINDOW_S + 1, last + 1)
        window = np.arange(begin, event.second + 1)
        calm = (
            window[(regimes.of_station[window] == IDLE) | (regimes.of_station[window] >= STEADY)]
            if begin >= 0
            else window[:0]
        )
        last = event.second
        known = calm[np.isfinite(traces.level_m[calm])]
        if known.size < MIN_POINTS or not 1 <= event.number <= len(station.control.start_levels_m):
            continue
        slope_m_s, level_m = np.polyfit(known - event.second, traces.level_m[known], 1)
        if slope_m_s * (1.0 if event.is_start else -1.0) <= 0.0:
            continue
        rows.append((event, float(level_m), float(slope_m_s)))
    sign = np.array([1.0 if event.is_start else -1.0 for event, _, _ in rows])
    slope_m_s = np.array([slope for _, _, slope in rows])
    early_m = noise_m * np.array([_earliness(abs(slope) / noise_m) for slope in slope_m_s])
    second = np.array([event.second for event, _, _ in rows], dtype=np.int64)
    deviation = np.sqrt((SCAN_S * slope_m_s) ** 2 + early_m**2 + noise_m**2 + TOLERANCE_M**2)
    return EventMisfit(
        bins=Bins(
            signal=np.where(sign > 0, START_LEVEL, STOP_LEVEL),
            regime=regimes.of_station[second],
            cycle=regimes.cycle[second],
            pump=np.full(second.size, NO_PUMP),
            second=second,
            deviation=deviation,
            floor=np.full(second.size, EVENT_FLOOR),
            tolerance=np.hypot(0.5 * SCAN_S * slope_m_s, 0.5 * noise_m) / deviation,
        ),
        number=np.array([event.number - 1 for event, _, _ in rows], dtype=np.int64),
        level_m=np.array([level for _, level, _ in rows]) + sign * (0.7 * early_m - 0.5 * np.abs(slope_m_s)),
        slope_m_s=slope_m_s,
        pattern=pattern,
    )


def _earliness(slope_ratio: float) -> float:
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
