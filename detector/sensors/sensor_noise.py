"""Sensors that have grown noisy, told from the readings of a run."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.robust import NORMAL_MEDIAN, median
from wetwell.protocols.arrays import Floats

NOISY_FACTOR = 3.0
MIN_DIFFERENCES = 30
DIFFERENCE_MEDIAN = NORMAL_MEDIAN / math.sqrt(2.0)
"""Standard deviation of normal numbers over the median of the size of their differences."""


def reading_noise(run: Run) -> Floats:
    """(2,) standard deviation of flow and head from second to second, as shares of their means; NaN if too short.

    From the median difference of neighbours: what changes slowly, or once, does not count.
    """
    if len(run.time_s) <= MIN_DIFFERENCES:
        return np.full(2, math.nan)
    is_next = run.time_s[1:] - run.time_s[:-1] <= 1.5
    if np.count_nonzero(is_next) < MIN_DIFFERENCES:
        return np.full(2, math.nan)
    noise = [
        DIFFERENCE_MEDIAN
        * float(median(np.abs((values[1:] - values[:-1]).compress(is_next))))
        / max(abs(float(values.mean())), 1e-9)
        for values in (run.flow_m3h, run.head_m)
    ]
    return np.array(noise)


def healthy_noise(noises: Sequence[Floats]) -> Floats:
    """(2,) median of the noise of healthy runs, NaN where it was never known."""
    known = np.array([noise for noise in noises if np.isfinite(noise).all()])
    return median(known) if len(known) else np.full(2, math.nan)


def noisy_sensors(run: Run, healthy: Floats) -> Mapping[str, float]:
    """Readings that are noisier than in health by more than `NOISY_FACTOR`, with that factor."""
    factors = reading_noise(run) / np.where(healthy > 0.0, healthy, math.nan)  # 0: the steps of the reading hide it
    return {
        name: round(float(factor), 1)
        for name, factor in zip(("flow_m3h", "head_m"), factors, strict=True)
        if factor > NOISY_FACTOR and name not in run.missing
    }
