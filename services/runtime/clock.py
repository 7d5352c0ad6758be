"""The wall clock, and which seconds of a station are due on it."""

import time

from wetwell.protocols.timestamps import NS_PER_S

MAX_CATCH_UP_S = 3600
"""Most seconds of a station that one tick brings; what is due beyond them comes with the next ticks."""


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


def due_seconds(elapsed_s: float, speed: float, done: int) -> int:
    """Seconds of the station that are due: the first one at once, then one each 1/speed.

    Examples
    --------
    >>> due_seconds(0.0, 1.0, 0), due_seconds(2.0, 1.0, 1), due_seconds(0.05, 600.0, 1)
    (1, 2, 30)
    """
    return min(int(elapsed_s * speed + 1e-6) + 1 - done, MAX_CATCH_UP_S)
