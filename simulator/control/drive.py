"""Variable-frequency drive: soft start, soft stop, reversal in mid-ramp, dwell; and how the shaft follows it."""

import math

from wetwell.protocols.jit import compiled

ROUNDING_HZ = 1e-9
"""Far above the rounding of a ramp's sum, far under any drive's resolution."""
AT_REST = 0.005
"""Speed ratio under which a shaft that runs out counts as standing."""


@compiled
def next_frequency_hz(
    frequency_hz: float, is_commanded: bool, rate_hz_s: float, minimum_hz: float, target_hz: float, dwell_s: float
) -> float:
    """Frequency one second later.

    Commanded, the drive goes from `minimum_hz` to `target_hz` at `rate_hz_s`; otherwise back to `minimum_hz`, where
    it stays while a dwell is left, then to zero. A command that changes in mid-ramp turns the ramp around.

    Examples
    --------
    >>> next_frequency_hz(0.0, True, 5.0, 20.0, 50.0, 0.0)
    25.0
    >>> next_frequency_hz(23.0, False, 5.0, 20.0, 50.0, 2.0)
    20.0
    >>> next_frequency_hz(20.0, False, 5.0, 20.0, 50.0, 0.0)
    0.0
    >>> next_frequency_hz(50.0, True, 5.0, 20.0, 42.0, 0.0)
    45.0
    """
    if is_commanded and frequency_hz <= target_hz:
        risen_hz = max(frequency_hz, minimum_hz) + rate_hz_s
        return risen_hz if risen_hz < target_hz - ROUNDING_HZ else target_hz
    lowest_hz = target_hz if is_commanded else minimum_hz
    if frequency_hz > lowest_hz:
        fallen_hz = frequency_hz - rate_hz_s
        return fallen_hz if fallen_hz > lowest_hz + ROUNDING_HZ else lowest_hz
    return minimum_hz if dwell_s > 0.0 and frequency_hz > 0.0 else 0.0


@compiled
def turned_ratio(
    commanded_ratio: float,
    before_ratio: float,
    ramp_power: float,
    lag_s: float,
    ramp_bow: float = 0.0,
    ramp_ahead: float = 0.0,
    ramp_knee: float = 0.25,
) -> float:
    r"""Speed ratio of the shaft for a commanded one: another shape of the ramp, and a first-order lag.

    $$N_1 = \begin{cases} N_c\, n / x & N_c < x \\ 1 - (1 - N_c) (1 - n) / (1 - x) & N_c \ge x \end{cases}, \qquad
    n = x + a (1 - x)$$

    $$N = \left((1 - b) N_1 + \frac{b}{2} (1 - \cos \pi N_1)\right)^p, \qquad
    N \leftarrow N_\text{before} + (N - N_\text{before}) (1 - e^{-1 / \tau})$$

    At rest and at nominal speed the shape makes no difference.

    Parameters
    ----------
    commanded_ratio, before_ratio : float
        Commanded now, and turned one second before. [1]
    ramp_power : float
        p; 1 follows the command. [1]
    lag_s : float
        τ; 0 follows at once. [s]
    ramp_bow : float
        b; share of an S, a half cosine. [1]
    ramp_ahead, ramp_knee : float
        a, share of what is left at a knee that the first of two slopes does as well, and x, the knee. [1]

    Examples
    --------
    >>> turned_ratio(0.5, 0.4, 1.0, 0.0), turned_ratio(0.5, 0.4, 2.0, 0.0)
    (0.5, 0.25)
    >>> turned_ratio(0.25, 0.0, 1.0, 0.0, 0.0, 0.5, 0.5), turned_ratio(0.75, 0.0, 1.0, 0.0, 0.0, 0.5, 0.5)
    (0.375, 0.875)
    """
    ratio = commanded_ratio
    if ramp_ahead != 0.0 and ratio < 1.0:
        left = (1.0 - ramp_ahead) * (1.0 - ramp_knee)
        ratio = ratio * (1.0 - left) / ramp_knee if ratio < ramp_knee else 1.0 - (1.0 - ratio) * (1.0 - ramp_ahead)
    if ramp_bow != 0.0 and ratio < 1.0:
        ratio = (1.0 - ramp_bow) * ratio + 0.5 * ramp_bow * (1.0 - math.cos(math.pi * ratio))
    if ramp_power != 1.0:
        ratio = ratio**ramp_power
    if lag_s <= 0.0:
        return ratio
    ratio = before_ratio + (ratio - before_ratio) * (1.0 - math.exp(-1.0 / lag_s))
    return ratio if commanded_ratio > 0.0 or ratio > AT_REST else 0.0
