"""What a wrong meter does to the residuals: it moves both at once, in a direction of its own."""

import numpy as np

from wetwell.detector.curves.datasheet import Curve
from wetwell.protocols.arrays import Floats


def flow_meter_direction(
    flow_m3h: float, own_m3h: float, total_m3h: float, curve: Curve, friction_h2_m5: float
) -> Floats:
    r"""(2,) change of (r_p, r_s) with the relative error g of the pump's flow meter. [m].

    $$\frac{\partial r_p}{\partial g} = -(c_1 + 2 c_2 Q^\star)\, Q^\star, \qquad
    \frac{\partial r_s}{\partial g} = -2 k Q_{tot} Q$$

    Parameters
    ----------
    flow_m3h : float
        Q* = Q/N. [m³/h]
    own_m3h, total_m3h : float
        Q through the meter and Q_tot in the main. [m³/h]
    curve : (c0, c1, c2)
    friction_h2_m5 : float
        k. [h²/m⁵]

    Examples
    --------
    >>> flow_meter_direction(200.0, 200.0, 200.0, (36.0, 0.0, -2.5e-4), 6e-4).tolist()
    [20.0, -48.0]
    """
    return np.array([-(curve[1] + 2.0 * curve[2] * flow_m3h) * flow_m3h, -2.0 * friction_h2_m5 * total_m3h * own_m3h])


def head_sensor_direction(speed_ratio: float) -> Floats:
    r"""(2,) change of (r_p, r_s) with a metre that the head sensor reads too much: (1/N², 1)."""
    return np.array([1.0 / speed_ratio**2, 1.0])
