"""Drift of the pump curve and of the system curve by nested F-tests: the first baseline method of the paper."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wetwell.detector.statistics.f_test import FTest, compare
from wetwell.protocols.arrays import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveFTests:
    """The same window tested for drift of the pump curve and of the system curve."""

    pump: FTest
    system: FTest


def _arrays(**values: npt.ArrayLike) -> list[Floats]:
    """Columns as finite float arrays of one length."""
    arrays = [np.asarray(value, dtype=float) for value in values.values()]
    for name, array in zip(values, arrays, strict=True):
        if array.ndim != 1 or array.shape != arrays[0].shape:
            raise ValueError(f"{name} must be one-dimensional and as long as time_s, got shape {array.shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} must be finite, got NaN or infinity")
    return arrays


def _centred(values: Floats) -> Floats:
    """Values with mean 0 and deviation 1; all 0 if they differ by no more than rounding."""
    mean = float(values.sum()) / max(values.size, 1)
    deviation = values - mean
    scale = math.sqrt(float(deviation @ deviation) / max(values.size, 1))
    return deviation / scale if scale > 1e-13 * abs(mean) else np.zeros_like(values)


def _drift_test(u: Floats, variable: Floats, response: Floats, degree: int) -> FTest:
    """Test a polynomial in the variable against the same with coefficients linear in the centred time u."""
    x = _centred(variable)
    columns = np.empty((2 * degree + 3, u.size))
    columns[0] = 1.0
    for power in range(1, degree + 1):
        np.multiply(columns[power - 1], x, out=columns[power])
    np.multiply(columns[: degree + 1], u, out=columns[degree + 1 : -1])
    columns[-1] = response
    return compare(columns.T, degree + 1)


def pump_curve_f_test(
    time_s: npt.ArrayLike, flow_m3h: npt.ArrayLike, head_m: npt.ArrayLike, speed_ratio: npt.ArrayLike
) -> FTest:
    r"""Nested F-test for drift of the pump curve, taken to nominal speed by the affinity laws.

    $$H / N^2 = (c_0 + \alpha_0 t) + (c_1 + \alpha_1 t) (Q / N) + (c_2 + \alpha_2 t) (Q / N)^2,
    \qquad \mathcal{H}_0: \alpha = 0$$

    Time and flow are centred and scaled inside, which changes neither F nor AIC.

    Parameters
    ----------
    time_s, flow_m3h, head_m, speed_ratio : (m,) arrays
        m >= 7; speed_ratio = frequency / nominal frequency, > 0. [s, m³/h, m, 1]

    Raises
    ------
    ValueError
        If a value is not finite, a speed not positive, lengths differ or there are fewer than 7 samples.

    Examples
    --------
    >>> time_s, flow_m3h = np.arange(100.0), 150.0 + 10.0 * np.sin(np.arange(100.0))
    >>> head_m = 36.0 - 1e-3 * flow_m3h**2 + 0.1 * np.cos(7.0 * time_s**2)
    >>> pump_curve_f_test(time_s, flow_m3h, head_m, np.ones(100)).log_p > -3.0
    True
    >>> pump_curve_f_test(time_s, flow_m3h, head_m - 0.01 * time_s, np.ones(100)).log_p < -100.0
    True
    """
    time, flow, head, speed = _arrays(time_s=time_s, flow_m3h=flow_m3h, head_m=head_m, speed_ratio=speed_ratio)
    if speed.size and speed.min() <= 0.0:
        raise ValueError(f"speed_ratio must be positive, got {speed.min():g}")
    return _drift_test(_centred(time), flow / speed, head / (speed * speed), 2)


def system_curve_f_test(time_s: npt.ArrayLike, flow_m3h: npt.ArrayLike, head_m: npt.ArrayLike) -> FTest:
    r"""Nested F-test for drift of the system curve.

    $$H = (H_s + \beta_0 t) + (k + \beta_1 t) Q^2, \qquad \mathcal{H}_0: \beta = 0$$

    Flow and head are taken as measured: scaled to nominal speed, the static head would become $H_s / N^2$, and a
    healthy change of speed would look like drift.

    Parameters
    ----------
    time_s, flow_m3h, head_m : (m,) arrays
        m >= 5; the flow is the one through the rising main. [s, m³/h, m]

    Raises
    ------
    ValueError
        If a value is not finite, lengths differ or there are fewer than 5 samples.

    Examples
    --------
    >>> time_s, flow_m3h = np.arange(100.0), 150.0 + 10.0 * np.sin(np.arange(100.0))
    >>> system_curve_f_test(time_s, flow_m3h, 2.0 + 6e-4 * flow_m3h**2).f
    0.0
    """
    time, flow, head = _arrays(time_s=time_s, flow_m3h=flow_m3h, head_m=head_m)
    return _drift_test(_centred(time), flow * flow, head, 1)
