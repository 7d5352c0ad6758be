"""Tangent residuals and the attribution index: the second baseline method of the paper."""

import math

import numpy as np
import numpy.typing as npt

from wetwell.detector.curves.datasheet import Curve
from wetwell.protocols.arrays import Floats


def normalise(flow_m3h: npt.ArrayLike, head_m: npt.ArrayLike, speed_ratio: npt.ArrayLike) -> tuple[Floats, Floats]:
    r"""Flow and head of the same duty at nominal speed.

    $$Q^\star = Q / N, \qquad H^\star = H / N^2, \qquad N = f / f_n$$

    Raises
    ------
    ValueError
        If a speed ratio is not positive.

    Examples
    --------
    >>> normalise([80.0], [16.0], [0.8])
    (array([100.]), array([25.]))
    """
    speed = np.asarray(speed_ratio, dtype=float)
    if (speed <= 0.0).any():
        raise ValueError(f"speed_ratio must be positive, got {np.nanmin(speed):g}")
    return np.asarray(flow_m3h, dtype=float) / speed, np.asarray(head_m, dtype=float) / (speed * speed)


def segment_means(values: npt.ArrayLike, samples_per_segment: int) -> Floats:
    """Means of consecutive segments, in the unit of the values.

    Parameters
    ----------
    values : (n,) array
        A NaN makes its segment NaN.
    samples_per_segment : int
        Length of a segment, >= 1; an incomplete last one is left out.

    Returns
    -------
    means : (n // samples_per_segment,) array

    Raises
    ------
    ValueError
        If the values are not one-dimensional or the segment is empty.

    Examples
    --------
    >>> segment_means([1.0, 2.0, 3.0, 4.0, 9.0], 2)
    array([1.5, 3.5])
    """
    array = np.asarray(values, dtype=float)
    if array.ndim != 1 or samples_per_segment < 1:
        raise ValueError(
            "values must be one-dimensional and samples_per_segment 1 or more, "
            f"got shape {array.shape} and {samples_per_segment}"
        )
    segments = array.size // samples_per_segment
    sums = array[: segments * samples_per_segment].reshape(segments, samples_per_segment).sum(axis=1)
    return np.asarray(sums / samples_per_segment)


def pump_slope(flow_m3h: npt.ArrayLike, curve: Curve) -> Floats:
    r"""Slope of the nominal-speed pump curve, $m_p = c_1 + 2 c_2 Q^\star$. [m/(m³/h)].

    Examples
    --------
    >>> float(pump_slope(100.0, (36.0, -0.5, -0.25)))
    -50.5
    """
    return np.asarray(curve[1] + 2.0 * curve[2] * np.asarray(flow_m3h, dtype=float))


def system_slope(flow_m3h: npt.ArrayLike, friction_h2_m5: float) -> Floats:
    r"""Slope of the system curve, $m_s = 2 k Q$. [m/(m³/h)].

    Examples
    --------
    >>> float(system_slope(100.0, 0.25))
    50.0
    """
    return np.asarray(2.0 * friction_h2_m5 * np.asarray(flow_m3h, dtype=float))


def tangent_residuals(
    flow_m3h: npt.ArrayLike,
    head_m: npt.ArrayLike,
    speed_ratio: npt.ArrayLike,
    *,
    curve: Curve,
    friction_h2_m5: float,
    samples_per_segment: int = 1,
    total_flow_m3h: npt.ArrayLike | None = None,
    system_head_m: npt.ArrayLike | None = None,
) -> tuple[Floats, Floats]:
    r"""Part of each move of the duty point that leaves the pump curve, and part that leaves the system curve.

    $$\psi_p = \Delta H^\star - m_p(\bar{Q}^\star)\, \Delta Q^\star, \qquad
    \psi_s = \Delta H - m_s(\bar{Q})\, \Delta Q$$

    Delta is the step between the means of consecutive segments. The slopes are taken at the mid-point of the step:
    for quadratic curves a move of any size along a curve then gives exactly 0. A moving pump curve shows in
    $\psi_p$, a moving system curve in $\psi_s$. The system residual stays at measured speed: at nominal speed the
    static head would become $H_s / N^2$, and a healthy change of speed would give $-2 H_s \dot{N} / N^3$. These are
    steps; divide by the time between segments for rates. The index is the same.

    Parameters
    ----------
    flow_m3h, head_m, speed_ratio : (n,) arrays
        Of one pump; speed_ratio = frequency / nominal frequency, > 0. [m³/h, m, 1]
    curve : (c0, c1, c2)
        Its nominal-speed curve; c0 is not used. [m, m/(m³/h), m/(m³/h)²]
    friction_h2_m5 : float
        k of the system curve. [h²/m⁵]
    samples_per_segment : int
        1 for differences of samples, 25 as in the paper's numerical study.
    total_flow_m3h : (n,) array, optional
        Flow of the rising main; the pump's own flow if not given. [m³/h]
    system_head_m : (n,) array, optional
        Head without what the level in the wet well does to the lift; the measured one if not given. [m]

    Returns
    -------
    psi_p, psi_s : (n // samples_per_segment - 1,) arrays
        Empty if there are fewer than two segments. [m]

    Raises
    ------
    ValueError
        If a speed ratio is not positive, an array not one-dimensional or a segment empty.

    Examples
    --------
    The pump loses speed that its drive does not report: a move along the system curve.

    >>> flow_m3h = np.array([160.0, 128.0, 96.0])
    >>> head_m = 2.0 + 0.0009765625 * flow_m3h**2
    >>> psi_p, psi_s = tangent_residuals(
    ...     flow_m3h, head_m, np.ones(3), curve=(36.0, 0.0, -0.00048828125), friction_h2_m5=0.0009765625
    ... )
    >>> psi_p, psi_s
    (array([-13.5, -10.5]), array([0., 0.]))
    >>> attribution_index(psi_p, psi_s)
    1.0
    """
    nominal_flow, nominal_head = (
        segment_means(values, samples_per_segment) for values in normalise(flow_m3h, head_m, speed_ratio)
    )
    total_flow = segment_means(flow_m3h if total_flow_m3h is None else total_flow_m3h, samples_per_segment)
    head = segment_means(head_m if system_head_m is None else system_head_m, samples_per_segment)
    slope_p = pump_slope((nominal_flow[1:] + nominal_flow[:-1]) / 2.0, curve)
    slope_s = system_slope((total_flow[1:] + total_flow[:-1]) / 2.0, friction_h2_m5)
    return (
        nominal_head[1:] - nominal_head[:-1] - slope_p * (nominal_flow[1:] - nominal_flow[:-1]),
        head[1:] - head[:-1] - slope_s * (total_flow[1:] - total_flow[:-1]),
    )


def attribution_index(psi_p: npt.ArrayLike, psi_s: npt.ArrayLike) -> float:
    r"""Share of the pump in the motion of the duty point.

    $$I_W = \frac{E_W |\psi_p|}{E_W |\psi_p| + E_W |\psi_s|}$$

    Range [0, 1]: 0 the system moved, 1 the pump moved, 0.5 if nothing moved or the window is empty. Noise alone gives
    a value set by the two slopes, not 0.5, so thresholds must come from healthy data.

    Raises
    ------
    ValueError
        If the sums are not finite or the lengths differ.

    Examples
    --------
    >>> attribution_index([3.0, -3.0], [1.0, -1.0]), attribution_index([0.0], [0.0])
    (0.75, 0.5)
    """
    pump, system = np.abs(np.asarray(psi_p, dtype=float)), np.abs(np.asarray(psi_s, dtype=float))
    if pump.shape != system.shape:
        raise ValueError(f"psi_p and psi_s must have one shape, got {pump.shape} and {system.shape}")
    moved_p, moved_s = float(pump.sum()), float(system.sum())
    if not math.isfinite(moved_p + moved_s):
        raise ValueError("psi_p and psi_s must be finite, got NaN or infinity")
    return moved_p / (moved_p + moved_s) if moved_p + moved_s > 0.0 else 0.5
