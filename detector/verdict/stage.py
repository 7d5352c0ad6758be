"""From the size of a fault to what to do about it: severity, trend, date and stage."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from wetwell.detector.inference.size_track import SizeTrack
from wetwell.detector.verdict.severity import SIGMAS_95
from wetwell.protocols.messages.verdict import Severity, Stage, Trend
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_DAY

CONFIDENCE = 0.95
"""With which a limit must be passed, and a stage be left again."""
PLAN_SHARE = 0.5
"""Of the limit, from which a visit is planned."""
STAGES: tuple[Stage, ...] = ("watch", "plan", "act")
HORIZON_DAYS = 1095.0
"""Three years: what is further away is not foretold. [d]"""
DAYS = np.geomspace(0.01, HORIZON_DAYS, 600)
DERIVATIVE_STEP = 1e-3
"""Of the size at the limit, over which a quantity is derived."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """In which a severity is told.

    Attributes
    ----------
    name : str
        With its unit at the end.
    limit : float
        Action limit, in that unit.
    size_at_limit : float
        The size of the fault there, > 0.
    of_size : callable
        From a size to the quantity.
    """

    name: str
    limit: float
    size_at_limit: float
    of_size: Callable[[float], float]


def severity_of(size: float, variance: float, quantity: Quantity) -> Severity:
    """A size with its 95 % interval, in a quantity."""
    half = SIGMAS_95 * variance**0.5
    low, high = sorted((quantity.of_size(size - half), quantity.of_size(size + half)))
    return Severity(
        quantity=quantity.name,
        value=round(quantity.of_size(size), 3),
        interval=(round(low, 3), round(high, 3)),
        limit=quantity.limit,
    )


def trend_of(track: SizeTrack, scale: float, quantity: Quantity) -> Trend:
    """Growth a day of a quantity, and when it reaches its limit, from the belief over its size.

    The date is that at which the limit is passed with one half, its interval from 2.5 to 97.5 %.
    """
    size, _ = track.size
    rate, variance = track.rate
    sign = -1.0 if size < 0.0 else 1.0
    step = DERIVATIVE_STEP * quantity.size_at_limit
    slope = (quantity.of_size(size + step) - quantity.of_size(size - step)) / (2.0 * step)
    half = SIGMAS_95 * variance**0.5
    low, high = sorted((slope * (rate - half), slope * (rate + half)))
    means, variances = track.ahead(DAYS, scale)
    passed = ndtr((sign * means - quantity.size_at_limit) / np.sqrt(np.maximum(variances, 1e-300)))
    is_beyond = sign * size >= quantity.size_at_limit
    earliest, middle, latest = (_first_ns(passed > share, track.time_ns) for share in (0.025, 0.5, 0.975))
    return Trend(
        per_day=_digits(slope * rate),
        interval=(_digits(low), _digits(high)),
        reaches_limit=None if is_beyond else middle,
        interval_at=(None, None) if is_beyond or middle is None else (earliest, latest),
    )


def _first_ns(is_passed: np.ndarray, now_ns: int | None) -> int | None:
    if now_ns is None or not is_passed.any():
        return None
    return min(now_ns + round(float(DAYS[is_passed.argmax()]) * NS_PER_DAY), MAX_STAMP_NS)


def _digits(value: float) -> float:
    return float(f"{value:.4g}")


def stage_of(size: float, variance: float, size_at_limit: float, before: Stage | None) -> Stage:
    """Stage of a fault of this size: by what it has passed with 95 %; left again where it lies under that with 95 %.

    Parameters
    ----------
    size, variance : float
        Of the fault, and of what is not known of it.
    size_at_limit : float
        In the same unit.
    before : Stage or None
        What was told of it last.

    Examples
    --------
    >>> [stage_of(size, 0.01, 1.0, None) for size in (0.3, 0.7, 1.1, 1.2)]
    ['watch', 'plan', 'plan', 'act']
    >>> stage_of(0.95, 0.01, 1.0, "act"), stage_of(0.8, 0.01, 1.0, "act")
    ('act', 'plan')
    """
    deviation = max(variance, 1e-300) ** 0.5
    beyond = [float(ndtr((abs(size) - share * size_at_limit) / deviation)) for share in (PLAN_SHARE, 1.0)]
    rank = sum(bool(probability > CONFIDENCE) for probability in beyond)
    if before is not None:
        while rank < STAGES.index(before) and 1.0 - beyond[rank] < CONFIDENCE:
            rank += 1
    return STAGES[rank]
