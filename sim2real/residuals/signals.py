"""Residuals of flow, head and power of each pump."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.materiality import Materiality
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.regimes import (
    IDLE,
    MULTI_PUMP,
    REGIMES,
    START_RAMP,
    STEADY,
    STOP_RAMP,
    Regimes,
    first_runs,
)
from wetwell.sim2real.recording.seconds import repeated, since_changes, trailing_means
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Doubt, Prediction
from wetwell.sim2real.residuals.bins import FLOW, HEAD, NO_PUMP, POWER, Bins, Seconds, binned
from wetwell.sim2real.residuals.drained import is_drained
from wetwell.sim2real.residuals.driven import does_work
from wetwell.sim2real.residuals.noise import BLOCK_S, Noise, configured_noise, noise_of
from wetwell.sim2real.residuals.telemetry import Pattern
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.telemetry.channels import channels_of

SIGNAL_OF: dict[AnalogueQuantity, int] = {"flow_m3h": FLOW, "head_m": HEAD, "power_kw": POWER}
STEADY_BIN_S = 20
TOLERANCE = 0.0025
"""Share by which a right model may be off: the fit of a curve, the length of a step."""
ZERO_TOLERANCE = 0.005
"""Share of the rated value by which a right model may be off near zero."""
TIMING_S = 0.2
"""Skew between signals that is nobody's fault: a scan takes its time."""
UNRESOLVED_STEP = 0.3
"""Change of a pump's speed from one second to the next, as a share of nominal, that a recording does not resolve."""
UNRESOLVED = 0.5 * np.exp(-np.arange(5.0))
"""Share of a jump of a signal that is open then, and in the seconds after: it began somewhere within a second."""
MIN_STRETCH_S = 60
RAMP_ROWS = 4
"""Rows in a ramp from which it is looked at."""
TRANSIENT_S = 2.0
"""Time for which a mean may miss, or have too much of, a flow at each start and stop: nobody sees its form. [s]"""
ZERO_SHARE = 0.001
"""Share of a flow under which a reading is a zero: what a filter forgets, or rounding leaves. [1]"""
QUANTUM_SHARE = 0.75
"""Share of a quantum by which a rounded value may be off: half of it, and the same if it is cut off instead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalResiduals:
    """Residuals of one signal of one pump, or of the level."""

    bins: Bins
    name: AnalogueQuantity
    pump: int
    seconds: Seconds
    recorded: Floats
    is_old: Flags
    pattern: Pattern | None

    def of(self, prediction: Prediction) -> Floats:
        """(bins,) means of recorded minus predicted, over their standard deviation.

        Where the telemetry holds or rounds values, only what that cannot explain counts.
        """
        values = prediction.level_m if self.pump == NO_PUMP else prediction.signals[self.name][self.pump]
        error = self.recorded - values[self.seconds.second]
        sensor = prediction.plant.sensors[_channel(prediction.plant, self.name, self.pump)]
        if self.pattern is not None:
            if sensor.deadband > 0.0 and self.pattern.pause_s > 0:
                low, high = _since(values, self.pattern.pause_s)
                nearest = np.clip(self.recorded, low[self.seconds.second], high[self.seconds.second])
                error = np.where(self.is_old, self.recorded - nearest, error)
            held = min(sensor.deadband, self.pattern.deadband) * self.is_old
            allowed = held + QUANTUM_SHARE * self.pattern.rounding(sensor.quantum)
            error = np.sign(error) * np.maximum(np.abs(error) - allowed, 0.0)
        if sensor.cutoff > 0.0:
            error -= _cut(self.recorded, values[self.seconds.second], sensor.cutoff)
        return np.asarray(self.seconds.means_of(error) / self.bins.deviation, dtype=np.float64)


def may_be_old(traces: Traces, values: Floats) -> Flags:
    """(n,) whether a value may have been sent before its second: it repeats the last one, or rows lie apart."""
    return repeated(values) | (not traces.is_each_second)


def _since(values: Floats, pause_s: int) -> tuple[Floats, Floats]:
    """(n,) least and most that a value was within a pause before, and now."""
    low, high = values.copy(), values.copy()
    for back in range(1, pause_s + 1):
        low[back:] = np.minimum(low[back:], values[:-back])
        high[back:] = np.maximum(high[back:], values[:-back])
    return low, high


def _cut(recorded: Floats, predicted: Floats, cutoff: float) -> Floats:
    """(n,) what a cutoff explains of recorded minus predicted: a zero only says that the value was under it.

    References
    ----------
    .. [1] J. Tobin, Estimation of relationships for limited dependent variables, Econometrica 26, 1958.
    """
    is_cut = (recorded < ZERO_SHARE * cutoff) & (predicted >= cutoff)
    was_cut = (predicted == 0.0) & (recorded >= cutoff)
    return np.asarray(cutoff * (was_cut.astype(np.float64) - is_cut), dtype=np.float64)


def _channel(plant: PlantParameters, name: AnalogueQuantity, pump: int) -> int:
    return channels_of(name, len(plant.pumps), None if pump == NO_PUMP else pump + 1)[0]


def pump_residuals(
    traces: Traces,
    station: Station,
    regimes: Regimes,
    plain: Prediction,
    doubt: Doubt,
    patterns: Mapping[AnalogueQuantity, Pattern],
) -> list[SignalResiduals]:
    """Of every measured signal of every pump.

    Parameters
    ----------
    plain : Prediction
        Of the station as it is: what the noise is relative to, the same for every candidate.
    doubt : Doubt
        What moments that the rows do not show leave open.
    """
    configured = configured_noise(station.sensors)
    is_step = steps(traces, plain)
    is_ramp = (regimes.of_pumps == START_RAMP) | (regimes.of_pumps == STOP_RAMP)
    is_shown = ~is_ramp | shows_ramps(traces, station)
    switched = _switched(traces, plain)
    has_lost = traces.is_each_second and traces.value != "held"
    block = max(round(BLOCK_S / traces.rate_s), 1)
    has_water = ~is_drained(traces, station, plain)
    has_past = ~first_runs(traces, regimes)
    has_head = does_work(traces, regimes, plain) if traces.span_s == 1 else np.ones(is_ramp.shape, dtype=np.bool_)
    found = []
    for name, recorded in traces.signals.items():
        counts = is_shown & has_water & has_past & (has_head | (name != "head_m"))
        expected = plain.signals[name]
        noise = noise_of(_steady_ratios(recorded, expected, regimes, has_lost), configured[name], TOLERANCE, block)
        for pump in range(traces.pumps):
            open_ = _unresolved(expected[pump], recorded[pump], is_step, regimes.of_pumps[pump], is_ramp[pump])
            if name in doubt.signals:
                open_ = np.hypot(open_, doubt.signals[name][pump])
            if traces.span_s > 1:
                open_ = np.hypot(open_, TRANSIENT_S * switched[pump] * np.max(expected[pump], initial=0.0))
            known = np.where(counts[pump], recorded[pump], np.nan)
            is_old, pattern = may_be_old(traces, known), patterns.get(name)
            one = _one_pump(
                name, pump, known, is_old, expected[pump], open_, regimes, noise, station.materiality, pattern
            )
            if one is not None:
                found.append(one)
    return found


def _steady_ratios(recorded: Floats, expected: Floats, regimes: Regimes, has_lost: bool) -> list[Floats]:
    """Recorded over expected in stretches in which nothing is switched; seconds without a value are lost, or none."""
    stretches: list[Floats] = []
    for pump in range(recorded.shape[0]):
        is_counted = np.isfinite(recorded[pump]) | has_lost
        regime = regimes.of_pumps[pump, is_counted]
        ratio = recorded[pump, is_counted] / np.maximum(expected[pump, is_counted], 1e-9)
        second = np.flatnonzero(is_counted)
        edges = np.flatnonzero(np.diff(regime)) + 1
        stretches += [
            ratio[rows]
            for rows in np.split(np.arange(regime.size), edges)
            if regime[rows[0]] == STEADY and second[rows[-1]] - second[rows[0]] + 1 >= MIN_STRETCH_S
        ]
    return stretches


def shows_ramps(traces: Traces, station: Station) -> bool:
    """Whether enough rows lie in a ramp to tell what happens there."""
    return traces.is_each_second or traces.rate_s * RAMP_ROWS <= station.control.ramp_s


def _switched(traces: Traces, plain: Prediction) -> Floats:
    """(pumps, n) how often a drive was switched in the interval of a mean, per second of it."""
    nominal_hz = plain.plant.nominal_frequency_hz[:, None]
    moved = np.abs(np.diff(traces.frequency_hz, axis=1, prepend=traces.frequency_hz[:, :1])) / nominal_hz
    return trailing_means(moved, traces.span_s)


def steps(traces: Traces, plain: Prediction) -> Flags:
    """(n,) whether a pump is switched faster than a recording of each second shows."""
    nominal_hz = plain.plant.nominal_frequency_hz[:, None]
    moved = np.abs(np.diff(traces.frequency_hz, axis=1, prepend=traces.frequency_hz[:, :1])) / nominal_hz
    return np.asarray(np.any(moved > UNRESOLVED_STEP, axis=0))


def _unresolved(expected: Floats, recorded: Floats, is_step: Flags, regime: Integers, is_ramp: Flags) -> Floats:
    """(n,) how far a right model may be off since nobody knows when within a second a pump was switched.

    What jumps then jumps later in a channel that comes late: so far as recorded ones usually jump at that second.
    """
    if not is_step.any():
        return np.zeros(expected.size)
    jumps = np.abs(np.diff(expected, prepend=expected[:1])) * is_step
    usual = np.abs(_usual(np.diff(recorded, prepend=recorded[:1]), regime, is_ramp))
    seen = np.zeros(expected.size)
    seen[is_ramp] = usual
    open_ = [np.convolve(one, UNRESOLVED)[: expected.size] for one in (jumps, seen)]
    return np.asarray(np.maximum(*open_), dtype=np.float64)


def _one_pump(
    name: AnalogueQuantity,
    pump: int,
    recorded: Floats,
    is_old: Flags,
    expected: Floats,
    unresolved: Floats,
    regimes: Regimes,
    noise: Noise,
    materiality: Materiality,
    pattern: Pattern | None,
) -> SignalResiduals | None:
    regime = regimes.of_pumps[pump]
    counted = np.isfinite(recorded) & (regime != IDLE)
    if not counted.any():
        return None
    is_ramp = (regime == START_RAMP) | (regime == STOP_RAMP)
    length_s = np.where(is_ramp, 1, STEADY_BIN_S)
    seconds = binned(counted, regime + 10 * regimes.cycle, length_s)
    running = counted & ((regime == STEADY) | (regime == MULTI_PUMP))
    rated = float(np.median(np.abs(recorded[running if running.any() else counted])))
    if rated == 0.0:
        return None
    slope = np.gradient(expected)
    usual = _usual(np.gradient(recorded), regime, is_ramp)
    slope[is_ramp] = np.where(np.abs(usual) > np.abs(slope[is_ramp]), usual, slope[is_ramp])
    size = _usual_size(np.where(counted, recorded, 0.0), expected, regime, is_ramp)
    noise_alone = noise.of_mean(seconds.counts) * seconds.means(size)
    late = np.hypot(TIMING_S * seconds.means(slope), seconds.means(unresolved))
    material = np.sqrt(
        (_share(materiality, name) * np.hypot(seconds.means(size), 0.5 * rated)) ** 2
        + (materiality.time_s * seconds.means(slope)) ** 2
        + seconds.means(unresolved) ** 2
    )
    deviation = np.sqrt(noise_alone**2 + (ZERO_TOLERANCE * rated) ** 2 / np.maximum(seconds.counts, 4.0) + late**2)
    return SignalResiduals(
        bins=seconds.bins(
            SIGNAL_OF[name],
            pump,
            regime,
            regimes.cycle,
            deviation=deviation,
            floor=(noise_alone / deviation) ** 2,
            tolerance=np.hypot(TOLERANCE * seconds.means(size), late) / deviation,
            material=material / deviation,
        ),
        name=name,
        pump=pump,
        seconds=seconds,
        recorded=recorded[seconds.second],
        is_old=is_old[seconds.second],
        pattern=pattern,
    )


def _usual_size(recorded: Floats, expected: Floats, regime: Integers, is_ramp: Flags) -> Floats:
    """(n,) size of a reading without its noise, by which the size of the noise is known.

    In ramps it is the usual one at that second of all of them; else what is expected, by the usual ratio of recorded
    and expected in the regime. With its own size a reading that happens to be high would count less, so that what
    shifts all readings would explain some of the noise.
    """
    size = np.abs(recorded)
    for steady in (STEADY, MULTI_PUMP):
        rows = (regime == steady) & (expected > 0.0) & (size > 0.0)
        if rows.any():
            size[rows] = np.median(size[rows] / expected[rows]) * expected[rows]
    size[is_ramp] = _usual(size, regime, is_ramp)
    return size


def _usual(values: Floats, regime: Integers, is_ramp: Flags) -> Floats:
    """Of those of (n,) values that are in ramps the mean of all that are known at that second of a ramp."""
    keys, group = np.unique((since_changes(regime) * len(REGIMES) + regime)[is_ramp], return_inverse=True)
    is_known = np.isfinite(values[is_ramp])
    sums = np.bincount(group, np.where(is_known, values[is_ramp], 0.0), keys.size)
    return np.asarray((sums / np.maximum(np.bincount(group, is_known, keys.size), 1.0))[group], dtype=np.float64)


def _share(materiality: Materiality, name: AnalogueQuantity) -> float:
    shares = {"flow_m3h": materiality.flow_share, "head_m": materiality.head_share}
    return shares.get(name, materiality.power_share)
