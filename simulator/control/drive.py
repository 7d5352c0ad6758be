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


@compiled
def slipped(
    shaft_ratio: float, flow_m3h: float, slip: float, shutoff_share: float, rated_flow_m3h: float
) -> tuple[float, float]:
    r"""Speed of a motor that slips along its tangent at a flow: that at no flow, and its fall with the flow.

    $$N = N_c - s\, \frac{M}{M_n}, \qquad \frac{M}{M_n} = N \left(s_0 N + (1 - s_0) \frac{Q}{Q_n}\right)$$

    Under a constant ratio of voltage and frequency a torque takes the same speed at any frequency.

    Parameters
    ----------
    shaft_ratio, flow_m3h : float
        Command N_c, and Q. [1, m³/h]
    slip : float
        s, at the rated torque. [1]
    shutoff_share : float
        s_0, share of the rated torque that is left at no flow. [1]
    rated_flow_m3h : float
        Q_n. [m³/h]

    Returns
    -------
    speed_ratio, fall_h_m3 : float
        N is the first less Q times the second. [1, h/m³]

    References
    ----------
    .. [1] B. K. Bose, Modern Power Electronics and AC Drives: speed at constant volts per hertz in open loop.

    Examples
    --------
    >>> speed_ratio, fall_h_m3 = slipped(1.0, 150.0, 0.05, 0.4, 200.0)
    >>> round(speed_ratio - 150.0 * fall_h_m3, 5), round(speed_ratio, 5)
    (0.95997, 0.98033)
    """
    if slip == 0.0:
        return shaft_ratio, 0.0
    by_speed, by_flow_h_m3 = slip * shutoff_share, slip * (1.0 - shutoff_share) / rated_flow_m3h
    linear = 1.0 + by_flow_h_m3 * flow_m3h
    root = math.sqrt(linear * linear + 4.0 * by_speed * shaft_ratio)
    speed_ratio = 2.0 * shaft_ratio / (linear + root)
    fall_h_m3 = by_flow_h_m3 * speed_ratio / root
    return speed_ratio + fall_h_m3 * flow_m3h, fall_h_m3
