"""The wall clock, and how often a station that runs on it is looked at."""

import time

from wetwell.protocols.timestamps import NS_PER_S


def now_ns() -> int:
    """Time of day in nanoseconds since 1970."""
    return time.time_ns()


def this_second_ns() -> int:
    """Time of day, cut to the whole second."""
    return now_ns() // NS_PER_S * NS_PER_S


def tick_period_s(speed: float) -> float:
    """Time between ticks on the wall for a station that runs `speed` times as fast: 1 s at 1, never under 0.05 s.

    Examples
    --------
    >>> tick_period_s(1.0), tick_period_s(5.0), tick_period_s(600.0)
    (1.0, 0.2, 0.05)
    """
    return min(1.0, max(0.05, 1.0 / speed))
