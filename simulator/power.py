"""Electrical and hydraulic power."""

import math

from wetwell.simulator.jit import compiled

WATER_DENSITY_KG_M3 = 1000.0
GRAVITY_M_S2 = 9.81
INRUSH_LIMIT = 5.0
"""Largest motor current, in rated currents."""


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
