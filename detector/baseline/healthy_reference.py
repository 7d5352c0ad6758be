"""What was learnt of a healthy pump: its baseline, and figures that do without the curves."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.detector.baseline.model import MIN_RUNS, Baseline
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.robust import NORMAL_MEDIAN, median
from wetwell.protocols.arrays import Floats

CHECK_FLOOR = 0.004
"""Least standard deviation of the logarithm of drawdown and power between runs."""
POWER_EXPONENT = 2.0
"""Of the speed: between 1 for a constant load and 3 for a free one; the scatter learnt covers the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Mean and variance of a figure that does without the curves, over healthy runs; NaN where it was never known."""

    mean: float
    variance: float


def learn_check(values: Sequence[float]) -> Check:
    """Median and robust variance of the finite values, NaN with fewer than `MIN_RUNS`."""
    known = np.array([value for value in values if math.isfinite(value)])
    if len(known) < MIN_RUNS:
        return Check(mean=math.nan, variance=math.nan)
    middle = float(median(known))
    deviation = NORMAL_MEDIAN * float(median(np.abs(known - middle)))
    return Check(mean=middle, variance=max(deviation, CHECK_FLOOR) ** 2 * (1.0 + 1.0 / len(known)))


def log_power(run: Run) -> float:
    """Logarithm of the electrical power of a run, taken to nominal speed; NaN where it is not measured."""
    known = np.isfinite(run.power_kw) & (run.power_kw > 0.0)
    if 2 * np.count_nonzero(known) < len(run.power_kw) or not known.any():
        return math.nan
    return float(np.mean(np.log(run.power_kw[known]) - POWER_EXPONENT * np.log(run.speed_ratio[known])))


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthyReference:
    """A learnt baseline with all that was learnt beside it.

    Attributes
    ----------
    version : int
        From 1; each learning phase adds one.
    learnt_ns : int
        Stamp of the end of the learning phase.
    baseline : Baseline
    drawdown, power : Check
    noise : (2,) array
        Of flow and head from second to second, as shares of their means.
    """

    version: int
    learnt_ns: int
    baseline: Baseline
    drawdown: Check
    power: Check
    noise: Floats
