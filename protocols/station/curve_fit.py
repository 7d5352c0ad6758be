"""Pump curve from datasheet points by least squares."""

import math
from collections.abc import Sequence


def fit_pump_curve(points: Sequence[tuple[float, float]]) -> tuple[float, float, float]:
    r"""Coefficients of the nominal-speed pump curve nearest to datasheet points.

    $$\min_c \sum_j (c_0 + c_1 Q_j + c_2 Q_j^2 - H_j)^2, \qquad c_0 > 0,\ c_1 \le 0,\ c_2 \le 0$$

    The bounds keep the head falling with the flow, as on a datasheet of a stable curve.

    Parameters
    ----------
    points : sequence of (flow_m3h, head_m)
        At least three different flows. [m³/h, m]

    Returns
    -------
    coefficients : (c0, c1, c2)
        [m, m/(m³/h), m/(m³/h)²]

    Raises
    ------
    ValueError
        If fewer than three different flows are given.

    Examples
    --------
    >>> c0, c1, c2 = fit_pump_curve([(0.0, 20.0), (100.0, 19.0), (200.0, 16.0)])
    >>> round(c0, 9), abs(round(c1, 9)), round(c2, 9)
    (20.0, 0.0, -0.0001)
    """
    import numpy as np  # noqa: PLC0415 - slow to import, as is the next, and needed by datasheet points only
    from scipy.optimize import lsq_linear  # noqa: PLC0415

    flow_m3h = np.array([flow for flow, _ in points], dtype=float)
    head_m = np.array([head for _, head in points], dtype=float)
    if np.unique(flow_m3h).size < 3:
        raise ValueError(f"a curve needs points at three different flows, got {np.unique(flow_m3h).size}")
    scale_m3h = float(flow_m3h.max())
    reduced = flow_m3h / scale_m3h
    design = np.column_stack([np.ones_like(reduced), reduced, reduced**2])
    solution = lsq_linear(design, head_m, bounds=([0.0, -np.inf, -np.inf], [np.inf, 0.0, 0.0]), method="bvls").x
    return float(solution[0]), float(solution[1]) / scale_m3h, float(solution[2]) / scale_m3h**2


def fit_error_m(points: Sequence[tuple[float, float]], coefficients: tuple[float, float, float]) -> float:
    """Root mean square distance in head between datasheet points and a curve, in m.

    Examples
    --------
    >>> fit_error_m([(0.0, 20.0), (100.0, 10.0)], (20.0, 0.0, -0.001))
    0.0
    """
    c0, c1, c2 = coefficients
    misfit_m = [c0 + c1 * flow + c2 * flow**2 - head for flow, head in points]
    return math.hypot(*misfit_m) / math.sqrt(len(misfit_m))
