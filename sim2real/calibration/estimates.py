"""Estimates of parameters with intervals, and intervals by a bootstrap over events."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Integers

RESAMPLES = 200
CONFIDENCE = 0.95
SDS = 1.96
"""Standard deviations of a normal distribution on each side of its mean, between which that share lies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One parameter: its value with a 95 % interval, or why it cannot be told; `value` is then the configured one.

    `prior` is mean and standard deviation before the recording, where the fit has one. `place` says where in the
    tree of the station file it stands; empty of a figure that only follows from others.
    """

    name: str
    unit: str
    value: float
    place: tuple[str | int, ...] = ()
    interval: tuple[float, float] | None = None
    prior: tuple[float, float] | None = None
    reason: str = ""

    def kept(self, reason: str) -> "Estimate":
        """The configured value, which the recording cannot tell for a reason."""
        return replace(self, reason=reason)

    def told(self, value: float, sd: float, *, lowest: float = -np.inf, reason: str = "") -> "Estimate":
        """A value with its standard deviation; no part of the interval lies under `lowest`."""
        low, high = max(value - SDS * sd, lowest), max(value + SDS * sd, lowest)
        return replace(self, value=float(value), interval=(float(low), float(high)), reason=reason)


def estimated(
    parameter: Estimate, figure: Callable[[Integers], float], events: int, rng: np.random.Generator
) -> Estimate:
    """A figure of all events, and its percentile interval under resampling of them."""
    value = figure(np.arange(events))
    drawn = [figure(rng.integers(0, events, events)) for _ in range(RESAMPLES)]
    low, high = np.quantile(drawn, [(1.0 - CONFIDENCE) / 2.0, (1.0 + CONFIDENCE) / 2.0])
    return replace(parameter, value=float(value), interval=(float(low), float(high)))
