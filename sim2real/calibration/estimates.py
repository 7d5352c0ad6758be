"""Estimates of parameters with intervals by a bootstrap over whole groups of rows, such as pump runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Floats, Integers

RESAMPLES = 200
CONFIDENCE = 0.95
SPREAD_NEEDED = 0.08
"""Relative spread of the flow (of Q/N, or of Q²) over which a slope can be told from an offset."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One parameter: its value with a 95 % interval, or why it cannot be told; `value` is then the configured one."""

    name: str
    unit: str
    value: float
    interval: tuple[float, float] | None = None
    reason: str = ""

    def kept(self, reason: str) -> "Estimate":
        """The configured value, which the recording cannot tell for a reason."""
        return replace(self, reason=reason)


def estimated(
    parameters: Sequence[Estimate],
    figures: Callable[[Integers], Floats],
    groups: Integers,
    rng: np.random.Generator,
) -> list[Estimate]:
    """Figures of all rows, and their percentile intervals under resampling of whole groups."""
    members = [np.flatnonzero(groups == group) for group in np.unique(groups)]
    values = figures(np.arange(groups.size))
    drawn = [
        figures(np.concatenate([members[k] for k in rng.integers(0, len(members), len(members))]))
        for _ in range(RESAMPLES)
    ]
    ends = np.quantile(np.array(drawn), [(1.0 - CONFIDENCE) / 2.0, (1.0 + CONFIDENCE) / 2.0], axis=0)
    return [
        replace(one, value=float(value), interval=(float(low), float(high)))
        for one, value, low, high in zip(parameters, values, *ends, strict=True)
    ]


def mean_estimated(parameter: Estimate, values: Floats, groups: Integers, rng: np.random.Generator) -> list[Estimate]:
    """Mean of values."""
    return estimated([parameter], lambda rows: np.array([values[rows].mean()]), groups, rng)


def polynomial_estimated(
    parameters: Sequence[Estimate], x: Floats, y: Floats, groups: Integers, rng: np.random.Generator
) -> list[Estimate]:
    """Coefficients of the polynomial through y over x, of rising power."""
    scale = np.mean(x)
    powers = np.arange(len(parameters))
    design = np.column_stack([(x / scale) ** power for power in range(len(parameters))])

    def coefficients(rows: Integers) -> Floats:
        fitted: Floats = np.linalg.lstsq(design[rows], y[rows], rcond=None)[0] / scale**powers
        return fitted

    return estimated(parameters, coefficients, groups, rng)


def is_spread(values: Floats) -> bool:
    """Whether values differ enough to tell a slope from an offset."""
    return bool(np.std(values) > SPREAD_NEEDED * np.mean(values))
