"""Residuals of flow, head and power of each pump, and of the level."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.regimes import IDLE, MULTI_PUMP, START_RAMP, STEADY, STOP_RAMP, Regimes
from wetwell.sim2real.recording.traces import Traces, repeated
from wetwell.sim2real.replay.replay import LEVEL_TIME_S, UNKNOWN_INFLOW_TIME_S, Prediction
from wetwell.sim2real.residuals.bins import FLOW, HEAD, LEVEL, NO_PUMP, POWER, Bins, Seconds, binned
from wetwell.sim2real.residuals.noise import GAUSSIAN_MAD, Noise, configured_noise, noise_of
from wetwell.sim2real.residuals.telemetry import Pattern
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.telemetry.channels import channels_of

SIGNAL_OF: dict[AnalogueQuantity, int] = {"flow_m3h": FLOW, "head_m": HEAD, "power_kw": POWER}
STEADY_BIN_S = 20
IDLE_LEVEL_BIN_S = 30
RAMP_LEVEL_BIN_S = 5
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
BALANCE_TOLERANCE = 0.004
"""Share of the rated flow by which a right balance may not close."""
MIN_STRETCH_S = 60
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
    is_repeated: Flags
    pattern: Pattern | None

    def of(self, prediction: Prediction, excused_s: int = 0) -> Floats:
        """(bins,) means of recorded minus predicted, over their standard deviation.

        Where the telemetry holds or rounds values, only what that cannot explain counts; in ramps, only what differs
        from all that is predicted within `excused_s`.
        """
        values = prediction.level_m if self.pump == NO_PUMP else prediction.signals[self.name][self.pump]
        error = self.recorded - values[self.seconds.second]
        if excused_s > 0:
            low, high = (
                near(values, 2 * excused_s + 1)[self.seconds.second] for near in (minimum_filter1d, maximum_filter1d)
            )
            is_ramp = np.isin(self.bins.regime, (START_RAMP, STOP_RAMP))[self.seconds.bin]
            error = np.where(is_ramp, self.recorded - np.clip(self.recorded, low, high), error)
        sensor = prediction.plant.sensors[_channel(prediction.plant, self.name, self.pump)]
        if self.pattern is not None:
            held = min(sensor.deadband, self.pattern.deadband) * self.is_repeated
            allowed = held + QUANTUM_SHARE * min(sensor.quantum, self.pattern.quantum)
            error = np.sign(error) * np.maximum(np.abs(error) - allowed, 0.0)
        return np.asarray(self.seconds.means_of(error) / self.bins.deviation, dtype=np.float64)


def _channel(plant: PlantParameters, name: AnalogueQuantity, pump: int) -> int:
    return channels_of(name, len(plant.pumps), None if pump == NO_PUMP else pump + 1)[0]


def pump_residuals(
    traces: Traces,
    station: Station,
    regimes: Regimes,
    plain: Prediction,
    patterns: Mapping[AnalogueQuantity, Pattern],
) -> list[SignalResiduals]:
    """Of every measured signal of every pump.

    Parameters
    ----------
    plain : Prediction
        Of the station as it is: what the noise is relative to, the same for every candidate.
    """
    configured = configured_noise(station.sensors)
    is_step = _steps(traces, plain)
    found = []
    for name, recorded in traces.signals.items():
        expected = plain.signals[name]
        noise = noise_of(_steady_ratios(recorded, expected, regimes), configured[name], TOLERANCE)
        for pump in range(traces.pumps):
            open_ = _unresolved(expected[pump], is_step)
            one = _one_pump(name, pump, recorded[pump], expected[pump], open_, regimes, noise, patterns.get(name))
            if one is not None:
                found.append(one)
    return found


def _steady_ratios(recorded: Floats, expected: Floats, regimes: Regimes) -> list[Floats]:
    stretches: list[Floats] = []
    for pump in range(recorded.shape[0]):
        regime = regimes.of_pumps[pump]
        edges = np.flatnonzero(np.diff(regime)) + 1
        stretches += [
            recorded[pump, rows] / np.maximum(expected[pump, rows], 1e-9)
            for rows in np.split(np.arange(regime.size), edges)
            if regime[rows[0]] == STEADY and rows.size >= MIN_STRETCH_S
        ]
    return stretches


def _steps(traces: Traces, plain: Prediction) -> Flags:
    """(n,) whether a pump is switched faster than a recording of each second shows."""
    nominal_hz = plain.plant.nominal_frequency_hz[:, None]
    moved = np.abs(np.diff(traces.frequency_hz, axis=1, prepend=traces.frequency_hz[:, :1])) / nominal_hz
    return np.asarray(np.any(moved > UNRESOLVED_STEP, axis=0))


def _unresolved(expected: Floats, is_step: Flags) -> Floats:
    """(n,) how far a right model may be off since nobody knows when within a second a pump was switched."""
    jumps = np.abs(np.diff(expected, prepend=expected[:1])) * is_step
    return np.asarray(np.convolve(jumps, UNRESOLVED)[: expected.size], dtype=np.float64)


def _one_pump(
    name: AnalogueQuantity,
    pump: int,
    recorded: Floats,
    expected: Floats,
    unresolved: Floats,
    regimes: Regimes,
    noise: Noise,
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
    slope = np.gradient(expected)
    size = np.abs(np.where(counted, recorded, 0.0))
    noise_alone = noise.of_mean(seconds.counts) * seconds.means(size)
    late = np.hypot(TIMING_S * seconds.means(slope), seconds.means(unresolved))
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
        ),
        name=name,
        pump=pump,
        seconds=seconds,
        recorded=recorded[seconds.second],
        is_repeated=repeated(recorded)[seconds.second],
        pattern=pattern,
    )


def level_residuals(
    traces: Traces,
    station: Station,
    regimes: Regimes,
    plain: Prediction,
    patterns: Mapping[AnalogueQuantity, Pattern],
) -> SignalResiduals:
    """Of the level."""
    counted = np.isfinite(traces.level_m)
    regime = regimes.of_station
    is_ramp = (regime == START_RAMP) | (regime == STOP_RAMP)
    seconds = binned(counted, regime + 10 * regimes.cycle, np.where(is_ramp, RAMP_LEVEL_BIN_S, IDLE_LEVEL_BIN_S))
    follow_s = UNKNOWN_INFLOW_TIME_S if traces.inflow_m3h is None else LEVEL_TIME_S
    rated_m3h = float(np.max(plain.plant.rated_flow_m3h))
    off_m = BALANCE_TOLERANCE * rated_m3h / 3600.0 / station.sump.mean_area_m2 * follow_s
    flow_m3h = plain.signals["flow_m3h"].sum(axis=0) if "flow_m3h" in plain.signals else np.zeros(regime.size)
    jumps_m3h = np.abs(np.diff(flow_m3h, prepend=flow_m3h[:1])) * _steps(traces, plain)
    forgotten = UNRESOLVED[0] * np.exp(-np.arange(3.0 * follow_s) / follow_s)
    open_m = np.convolve(jumps_m3h, forgotten)[: regime.size] / 3600.0 / station.sump.mean_area_m2
    balance_m = np.hypot(off_m, seconds.means(open_m))
    noise_m2 = level_noise_m(traces, station) ** 2 / seconds.counts
    if traces.inflow_m3h is None:  # the observer lags behind an inflow that it does not know
        error_m = np.abs(seconds.means_of(traces.level_m[seconds.second] - plain.level_m[seconds.second]))
        is_idle = seconds.first(regime) == IDLE
        balance_m = np.hypot(balance_m, np.median(error_m[is_idle]) / GAUSSIAN_MAD if is_idle.any() else 0.0)
    return SignalResiduals(
        bins=seconds.bins(
            LEVEL,
            NO_PUMP,
            regime,
            regimes.cycle,
            deviation=np.sqrt(noise_m2 + balance_m**2),
            floor=noise_m2 / (noise_m2 + balance_m**2),
            tolerance=balance_m / np.sqrt(noise_m2 + balance_m**2),
        ),
        name="level_m",
        pump=NO_PUMP,
        seconds=seconds,
        recorded=traces.level_m[seconds.second],
        is_repeated=repeated(traces.level_m)[seconds.second],
        pattern=patterns.get("level_m"),
    )


def level_noise_m(traces: Traces, station: Station) -> float:
    """Standard deviation of the level sensor's noise. [m]."""
    bends = np.diff(traces.level_m, n=2)
    bends = np.abs(bends[np.isfinite(bends)])
    seen_m = float(np.median(bends)) / GAUSSIAN_MAD / np.sqrt(6.0) if bends.size else 0.0
    return max(seen_m, 0.5 * station.sensors.level_noise_m, 1e-4)
