"""Residuals of the controller: the level at which it starts and stops pumps, against its thresholds."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import ndtr

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import LEVEL
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.regimes import Regimes
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.level_noise import MIN_NOISE_M, level_noise_m, told_noise_m
from wetwell.sim2real.replay.observer import Observer
from wetwell.sim2real.replay.replay import Prediction
from wetwell.sim2real.replay.steps import between_steps_m
from wetwell.sim2real.replay.stretches import Stretches, switches_of
from wetwell.sim2real.residuals.bins import NO_PUMP, START_LEVEL, STOP_LEVEL, Bins
from wetwell.sim2real.residuals.signals import QUANTUM_SHARE
from wetwell.sim2real.residuals.telemetry import Pattern
from wetwell.simulator.telemetry.channels import channels_of

SCAN_S = 1.0
WAITING_S = 2.0
"""Scans that a timer may take beside its delay."""
TOLERANCE_M = 0.002
EVENT_FLOOR = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class EventResiduals:
    """Residuals at starts and stops, (events,) each; `number` is that of the threshold, from 0.

    `noise_m` is what the controller sees, and `since_s` the time since the event before. Where the level is known
    when it passes from step to step, it may be off by `half_step_m`: nobody says whether it is rounded or cut off.
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
    """Of every start and stop that follows a straight stretch of the level that an observer follows.

    Between rows that lie apart a command came at any time that their frequencies leave open, evenly. Cycles may keep
    in step with the rows, so that what this leaves open may be alike in all of them: it is allowed.
    """
    noise_m, level_m, half_step_m = level_noise_m(traces, station), traces.level_m, 0.0
    if observer.is_of_steps:
        noise_m, level_m = told_noise_m(traces, station, observer.level_m), between_steps_m(observer.level_m)
        half_step_m = 0.0 if pattern is None or pattern.is_usual else 0.5 * pattern.quantum
        pattern = None
    switches = switches_of(traces, station, regimes, level_m)
    stretches, slope_m_s = switches.stretches, switches.stretches.lines()[1]
    second, before = stretches.second, stretches.counted[:, -1]
    is_start = np.array([event.is_start for event in switches.events], dtype=np.bool_)
    open_m = slope_m_s * switches.open_s / np.sqrt(12.0)
    seen_m = noise_m  # between rows an inflow bends the level, which is no noise that a controller sees
    if not traces.is_each_second:
        seen_m = min(noise_m, max(station.sensors.level_noise_m, MIN_NOISE_M))
    early_m = seen_m * _earliness(np.abs(slope_m_s) / seen_m)
    read_m2 = noise_m**2 * (1.0 + stretches.leverage)
    deviation = np.sqrt(
        (SCAN_S * slope_m_s) ** 2 + open_m**2 + switches.bent_m**2 + early_m**2 + read_m2 + TOLERANCE_M**2
    )
    return EventResiduals(
        bins=Bins(
            signal=np.where(is_start, START_LEVEL, STOP_LEVEL),
            regime=regimes.of_station[before],
            cycle=regimes.cycle[second],
            pump=np.full(second.size, NO_PUMP),
            second=second,
            deviation=deviation,
            floor=np.full(second.size, EVENT_FLOOR),
            tolerance=np.hypot(0.5 * SCAN_S * slope_m_s, 0.5 * seen_m) / deviation,
            material=np.hypot(np.hypot(station.materiality.threshold_m, SCAN_S * slope_m_s), open_m) / deviation,
        ),
        number=np.array([event.number - 1 for event in switches.events], dtype=np.int64),
        since_s=switches.since_s,
        stretches=stretches,
        noise_m=seen_m,
        pattern=pattern,
        half_step_m=half_step_m,
    )


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
