"""Electrical and hydraulic power."""

import math
from collections.abc import Sequence

import numpy as np

from wetwell.protocols.jit import compiled, plain

Points = Sequence[tuple[float, float]]

WATER_DENSITY_KG_M3 = 1000.0
GRAVITY_M_S2 = 9.81
INRUSH_LIMIT = 5.0
"""Largest motor current, in rated currents."""
STANDING_LOSS_SHARE = 0.02
"""Losses of motor and drive that do not depend on the load, over the rated shaft power, unless told. [1]"""


@compiled
def electrical_power_kw(voltage_v: float, rated_current_a: float, power_factor: float, speed_ratio: float) -> float:
    r"""Three-phase input power of a motor whose current follows the frequency.

    $$P = \sqrt{3}\, U I \cos\varphi, \qquad I = \min(I_n N,\ 5 I_n)$$

    The paper's model: the current does not know the load. [V, A, 1, 1 -> kW]

    Examples
    --------
    >>> round(electrical_power_kw(400.0, 30.0, 0.9, 1.0), 3)
    18.706
    """
    current_a = rated_current_a * min(speed_ratio, INRUSH_LIMIT)
    return math.sqrt(3.0) * voltage_v * current_a * power_factor / 1000.0


@compiled
def hydraulic_power_kw(flow_m3h: float, head_m: float) -> float:
    r"""Power that the water takes up, in kW: $P = \rho g Q H$, from m³/h and m.

    Examples
    --------
    >>> round(hydraulic_power_kw(200.0, 26.0), 1)
    14.2
    """
    return WATER_DENSITY_KG_M3 * GRAVITY_M_S2 * flow_m3h / 3600.0 * head_m / 1000.0


@compiled
def shaft_power_kw(
    speed_ratio: float, flow_m3h: float, rated_flow_m3h: float, rated_shaft_kw: float, shutoff_share: float
) -> float:
    r"""Shaft power of a radial pump: linear in the flow, by the affinity laws in the speed.

    $$P = N^3 P_n \left(s + (1 - s) \frac{Q}{N Q_n}\right)$$

    so that the efficiency $\rho g Q H / P$ depends on flow and speed, and is the rated one at the rated duty.

    Parameters
    ----------
    speed_ratio, flow_m3h : float
        N and Q. [1, m³/h]
    rated_flow_m3h, rated_shaft_kw : float
        Q_n and P_n, at the rated duty. [m³/h, kW]
    shutoff_share : float
        s, share of the rated power at zero flow. [1]

    References
    ----------
    .. [1] After J. F. Gülich, Centrifugal Pumps, Springer: power curves of radial impellers.

    Examples
    --------
    >>> shaft_power_kw(1.0, 200.0, 200.0, 15.0, 0.4), round(shaft_power_kw(1.0, 0.0, 200.0, 15.0, 0.4), 9)
    (15.0, 6.0)
    """
    return (
        speed_ratio**2
        * rated_shaft_kw
        * (shutoff_share * speed_ratio + (1.0 - shutoff_share) * flow_m3h / rated_flow_m3h)
    )


def shaft_points(
    curve: tuple[float, float, float],
    power_points: Points | None,
    efficiency_points: Points | None,
) -> Points:
    r"""Points (flow, shaft power) of a datasheet; of efficiencies $P = \rho g Q H(Q) / \eta$.

    Parameters
    ----------
    curve : (c0, c1, c2)
        At nominal speed. [m, m/(m³/h), m/(m³/h)²]
    power_points, efficiency_points : sequence of (flow_m3h, power_kw) and (flow_m3h, share), optional
        At nominal speed, at most one of them. [m³/h, kW; m³/h, 1]

    Returns
    -------
    points : sequence of (flow_m3h, power_kw)
        Empty without any. [m³/h, kW]

    Examples
    --------
    >>> [(flow_m3h, round(kw, 2)) for flow_m3h, kw in shaft_points((36.0, 0.0, -2.5e-4), None, [(200.0, 0.8)])]
    [(200.0, 17.71)]
    """
    if power_points is not None:
        return power_points
    c0, c1, c2 = curve
    return [
        (flow_m3h, plain(hydraulic_power_kw)(flow_m3h, c0 + (c1 + c2 * flow_m3h) * flow_m3h) / share)
        for flow_m3h, share in efficiency_points or ()
    ]


def power_line(points: Points, shutoff_share: float, rated_flow_m3h: float) -> tuple[float, float]:
    r"""Line of the shaft power over the flow, nearest to points of a datasheet.

    $$P = P_0 + b\, Q, \qquad P_0 \ge 0,\ P_0 + b\, Q_n > 0$$

    Points at one flow only give its size; its shut-off share is then the given one.

    Parameters
    ----------
    points : sequence of (flow_m3h, power_kw)
        At least one. [m³/h, kW]
    shutoff_share : float
        Share of the power at the rated flow that is taken at no flow. [1]
    rated_flow_m3h : float
        [m³/h]

    Returns
    -------
    shutoff_kw, slope_kwh_m3 : float
        P0 and b. [kW, kWh/m³]

    Examples
    --------
    >>> line = power_line([(0.0, 6.0), (100.0, 11.0), (200.0, 16.0)], 0.4, 200.0)
    >>> round(line[0], 9), round(line[1], 9)
    (6.0, 0.05)
    >>> line = power_line([(100.0, 7.0)], 0.4, 200.0)
    >>> round(line[0], 9), round(line[1], 9)
    (4.0, 0.03)
    """
    flow_m3h, power_kw = np.array(points, dtype=float).T
    spread = flow_m3h - flow_m3h.mean()
    if np.any(spread != 0.0):
        slope_kwh_m3 = float(spread @ power_kw / (spread @ spread))
        shutoff_kw = float(power_kw.mean() - slope_kwh_m3 * flow_m3h.mean())
        if shutoff_kw < 0.0:
            shutoff_kw, slope_kwh_m3 = 0.0, float(flow_m3h @ power_kw / (flow_m3h @ flow_m3h))
        if shutoff_kw + slope_kwh_m3 * rated_flow_m3h > 0.0:
            return shutoff_kw, slope_kwh_m3
    at_flow = shutoff_share + (1.0 - shutoff_share) * float(flow_m3h.mean()) / rated_flow_m3h
    rated_kw = float(power_kw.mean()) / at_flow
    return shutoff_share * rated_kw, (1.0 - shutoff_share) * rated_kw / rated_flow_m3h


@compiled
def loaded_power_kw(
    shaft_kw: float,
    rated_shaft_kw: float,
    motor_efficiency: float,
    drive_efficiency: float,
    losses_share: float = STANDING_LOSS_SHARE,
) -> float:
    r"""Input power of drive and motor under a load.

    $$P_\text{el} = \frac{P + c\, P_n}{(1 + c)\, \eta_m \eta_d}$$

    so that the losses at rated load are those of the efficiencies. [kW, kW, 1, 1, 1 -> kW]

    Examples
    --------
    >>> round(loaded_power_kw(15.0, 15.0, 0.92, 0.97), 3)
    16.809
    """
    total = motor_efficiency * drive_efficiency
    return (shaft_kw + losses_share * rated_shaft_kw) / (total * (1.0 + losses_share))
