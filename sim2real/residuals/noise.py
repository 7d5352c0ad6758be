"""Noise of the signals of a recording, from the recording itself: how a perfect model would still miss it."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Sensors
from wetwell.sim2real.recording.seconds import GAUSSIAN_MAD

BLOCK_S = 20
MIN_VALUES = 8
MIN_BLOCKS = 5
MOST = 1.5
"""Noise over the configured one, beyond which it is taken for a gap."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Standard deviations of one signal: of a single value, and of the part that a mean does not average away."""

    single: float
    slow: float

    def of_mean(self, count: Floats) -> Floats:
        """Standard deviation of means over `count` seconds."""
        fast = max(self.single**2 - self.slow**2, 0.0)
        return np.asarray(np.sqrt(fast / np.maximum(count, 1.0) + self.slow**2), dtype=np.float64)


def configured_noise(sensors: Sensors) -> dict[AnalogueQuantity, float]:
    """Noise of each quantity by the station file: of the level in m, of the others as a share of the reading."""
    return {
        "level_m": sensors.level_noise_m,
        "inflow_m3h": sensors.inflow_noise,
        "flow_m3h": sensors.flow_noise,
        "head_m": sensors.head_noise,
        "power_kw": sensors.power_noise,
    }


def noise_of(stretches: list[Floats], configured: float, tolerance: float, block: int = BLOCK_S) -> Noise:
    """Noise from stretches in which nothing is switched.

    What means over twenty seconds, or single rows where these are slower, scatter about a straight line, beyond what
    white noise explains, is slow noise; constant errors and trends do not count as noise. Of slow rows a stretch has
    few, and a line takes most of slow noise away: there means of stretches that follow each other add theirs.

    Parameters
    ----------
    stretches : list of (k,) arrays
        Consecutive values, over what is expected; NaN is "no value".
    configured : float
        Standard deviation of the sensor by the station file.
    tolerance : float
        What a model may always be off.
    block : int
        Values in twenty seconds.
    """
    fine = _robust_sd([np.diff(values, n=2) for values in stretches], np.sqrt(6.0))
    coarse = [_means(values, block) for values in stretches]
    moved = _robust_sd([_without_line(values) for values in coarse], 1.0)
    spread = _robust_sd([_without_line(values) for values in stretches], 1.0)
    if not np.isfinite(fine):
        return Noise(single=float(np.hypot(configured, tolerance)), slow=tolerance)
    most = MOST * configured if configured > 0.0 else np.inf
    single = min(max(fine, spread if np.isfinite(spread) else 0.0, 0.5 * configured), most)
    slow = max(moved**2 - fine**2 / block, 0.0) if np.isfinite(moved) else 0.0
    if block < BLOCK_S:
        slow += _between(stretches, fine)
    slow = min(slow, (most / MOST) ** 2)
    if block < BLOCK_S:
        single = min(max(single, float(np.hypot(fine, np.sqrt(slow)))), most)
    return Noise(single=float(np.hypot(single, tolerance)), slow=float(np.sqrt(slow + tolerance**2)))


def _between(stretches: list[Floats], fine: float) -> float:
    """Variance of the means of stretches about those before and after, beyond what white noise explains."""
    means = np.array([np.nanmean(values) for values in stretches if np.isfinite(values).any()])
    counts = [float(np.isfinite(values).sum()) for values in stretches]
    bends = _robust_sd([np.diff(means, n=2)], np.sqrt(6.0))
    return max(bends**2 - fine**2 / float(np.median(counts)), 0.0) if np.isfinite(bends) else 0.0


def _robust_sd(pieces: list[Floats], gain: float) -> float:
    values = np.concatenate(pieces) if pieces else np.zeros(0)
    values = values[np.isfinite(values)]
    if values.size < MIN_VALUES:
        return float("nan")
    return float(np.median(np.abs(values)) / GAUSSIAN_MAD / gain)


def _means(values: Floats, block: int) -> Floats:
    count = values.size // block
    blocks = values[: count * block].reshape(count, block)
    known = np.isfinite(blocks)
    sums = np.where(known, blocks, 0.0).sum(axis=1)
    return np.where(known.sum(axis=1) > block // 2, sums / np.maximum(known.sum(axis=1), 1), np.nan)


def _without_line(values: Floats) -> Floats:
    known = np.flatnonzero(np.isfinite(values))
    if known.size < MIN_BLOCKS:
        return np.zeros(0)
    return np.asarray(values[known] - np.polyval(np.polyfit(known, values[known], 1), known), dtype=np.float64)
