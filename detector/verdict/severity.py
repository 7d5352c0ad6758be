"""How bad a fault is, in the words of those who mend it."""

import math
from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import Curve
from wetwell.protocols.arrays import Floats

SIGMAS_95 = 1.96


def speed_loss(shift_m: float, curve: Curve, flow_m3h: float) -> float:
    r"""Loss λ of effective speed that lowers the pump curve by so much at this flow.

    $$c_0 \bigl(1 - (1-\lambda)^2\bigr) + c_1 \lambda\, Q = -\Delta r_p$$

    Parameters
    ----------
    shift_m : float
        Δr_p, negative for a loss. [m]
    curve : (c0, c1, c2)
    flow_m3h : float
        Q/N. [m³/h]

    Returns
    -------
    loss : float
        1 where the pump gives nothing at all; negative where it gives more.

    Examples
    --------
    >>> round(speed_loss(-36.0 * (1.0 - 0.9**2), (36.0, 0.0, -2.5e-4), 100.0), 6)
    0.1
    """
    c0, linear = curve[0], 2.0 * curve[0] + curve[1] * flow_m3h
    root = linear * linear + 4.0 * c0 * shift_m
    return min((linear - math.sqrt(root)) / (2.0 * c0), 1.0) if root > 0.0 else 1.0


def severity(
    shift_m: Floats, deviation_m: Floats, curve: Curve, flow_m3h: float, friction_m: float
) -> dict[str, Any]:
    """Severity of the shifts of both curves with 95 % intervals, as a message carries it.

    Parameters
    ----------
    shift_m, deviation_m : (2,) arrays
        Of (r_p, r_s), and standard deviations. [m]
    curve : (c0, c1, c2)
    flow_m3h : float
        Q/N. [m³/h]
    friction_m : float
        k Q_tot² in health at the flow of the run; the rise of the main is told as one of k, or of the static head: at
        one operating point they are the same. [m]
    """
    pump_m = shift_m[0] + SIGMAS_95 * deviation_m[0] * np.array([0.0, 1.0, -1.0])
    system_m = shift_m[1] + SIGMAS_95 * deviation_m[1] * np.array([0.0, -1.0, 1.0])
    figures = {
        "speed_loss_percent": [100.0 * speed_loss(float(value), curve, flow_m3h) for value in pump_m],
        "friction_rise_percent": list(100.0 * system_m / friction_m) if friction_m > 0.0 else [math.nan] * 3,
        "static_head_rise_m": list(system_m),
    }
    return {
        name: {"value": _rounded(value), "interval": [_rounded(low), _rounded(high)]}
        for name, (value, low, high) in figures.items()
        if math.isfinite(value)
    }


def _rounded(value: float) -> float:
    return round(float(value), 3)
