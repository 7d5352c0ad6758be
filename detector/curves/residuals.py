"""Residuals of a pump and of a rising main: how far the measured head lies from each curve."""

from typing import Any

import numpy as np
import numpy.typing as npt

from wetwell.detector.curves.datasheet import Curve
from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled


def _distances(
    flow: Any, head: Any, speed: Any, total: Any, c0: float, c1: float, c2: float, static_m: float, friction: float
) -> tuple[Any, Any]:
    reduced = flow / speed
    return head / (speed * speed) - c0 - (c1 + c2 * reduced) * reduced, head - static_m - friction * total * total


distances = compiled(_distances)
"""The residuals of one sample, for compiled code; the same arithmetic as in `level_residuals`."""


def level_residuals(
    flow_m3h: npt.ArrayLike,
    head_m: npt.ArrayLike,
    speed_ratio: npt.ArrayLike,
    *,
    curve: Curve,
    static_head_m: float,
    friction_h2_m5: float,
    total_flow_m3h: npt.ArrayLike | None = None,
) -> tuple[Floats, Floats]:
    r"""Distance of the head from the nominal-speed pump curve and from the system curve.

    $$r_p = \frac{H}{N^2} - c_0 - c_1 \frac{Q}{N} - c_2 \Big(\frac{Q}{N}\Big)^2, \qquad r_s = H - H_s - k Q_{tot}^2$$

    They are the time integrals of the tangent residuals, so noise does not grow as in a derivative, and a fault stays
    visible after it has stopped growing. r_s is not scaled to nominal speed: a change of speed leaves both at 0.

    Parameters
    ----------
    flow_m3h, head_m, speed_ratio : (n,) arrays
        Of one pump; speed_ratio = frequency / nominal frequency, > 0. NaN gives NaN. [m³/h, m, 1]
    curve : (c0, c1, c2)
        [m, m/(m³/h), m/(m³/h)²]
    static_head_m, friction_h2_m5 : float
        System curve. [m, h²/m⁵]
    total_flow_m3h : (n,) array, optional
        Flow of the rising main; the pump's own flow if not given. [m³/h]

    Returns
    -------
    r_p, r_s : (n,) arrays
        Negative r_p: the pump gives less head than its curve; positive r_s: the main takes more than its curve. [m]

    Raises
    ------
    ValueError
        If a speed ratio is not positive.

    Examples
    --------
    >>> r_p, r_s = level_residuals(
    ...     [200.0], [25.0], [1.0], curve=(36.0, 0.0, -2.5e-4), static_head_m=2.0, friction_h2_m5=5e-4
    ... )
    >>> r_p, r_s
    (array([-1.]), array([3.]))
    """
    flow, head, speed = (np.asarray(value, dtype=float) for value in (flow_m3h, head_m, speed_ratio))
    if (speed <= 0.0).any():
        raise ValueError(f"speed_ratio must be positive, got {np.nanmin(speed):g}")
    total = flow if total_flow_m3h is None else np.asarray(total_flow_m3h, dtype=float)
    return _distances(flow, head, speed, total, *curve, static_head_m, friction_h2_m5)
