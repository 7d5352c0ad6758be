"""Electrical and hydraulic power."""

import math

from wetwell.protocols.jit import compiled

WATER_DENSITY_KG_M3 = 1000.0
GRAVITY_M_S2 = 9.81
INRUSH_LIMIT = 5.0
"""Largest motor current, in rated currents."""
STANDING_LOSS_SHARE = 0.02
"""Losses of motor and drive that do not depend on the load, as a share of the rated shaft power."""


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


@compiled
def loaded_power_kw(
    shaft_kw: float, rated_shaft_kw: float, motor_efficiency: float, drive_efficiency: float
) -> float:
    r"""Input power of drive and motor under a load.

    $$P_\text{el} = \frac{P + 0.02\, P_n}{\eta_m \eta_d} \qquad \text{with } \eta_m \eta_d \text{ at rated load}$$

    Scaled so that the losses at rated load are those of the efficiencies. [kW, kW, 1, 1 -> kW]

    Examples
    --------
    >>> round(loaded_power_kw(15.0, 15.0, 0.92, 0.97), 3)
    16.809
    """
    total = motor_efficiency * drive_efficiency
    return (shaft_kw + STANDING_LOSS_SHARE * rated_shaft_kw) / (total * (1.0 + STANDING_LOSS_SHARE))
