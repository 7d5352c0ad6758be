"""Tail of the F distribution, exact where a p-value underflows."""

import math
from typing import Final

import numpy as np

from wetwell.protocols.jit import compiled

_EPS: Final = float(np.finfo(float).eps)
_LEAST_DIVISOR: Final = 1e-300
_LARGE: Final = 10.0
"""From here on Stirling's series is exact to rounding."""
_MAX_TERMS: Final = 10_000


@compiled
def _stirling(z: float) -> float:
    """What Stirling's formula lacks of the logarithm of the gamma function."""
    y = 1.0 / (z * z)
    return (1.0 / 12.0 - y * (1.0 / 360.0 - y * (1.0 / 1260.0 - y * (1.0 / 1680.0 - y / 1188.0)))) / z


@compiled
def _log_beta(a: float, b: float) -> float:
    """Logarithm of the beta function, without the difference of two large numbers."""
    small, large = min(a, b), max(a, b)
    if large < _LARGE:
        return math.lgamma(small) + math.lgamma(large) - math.lgamma(small + large)
    total = small + large
    log_ratio = small - (large - 0.5) * math.log1p(small / large) - small * math.log(total)
    return math.lgamma(small) + log_ratio + _stirling(large) - _stirling(total)


@compiled
def _fraction(a: float, b: float, x: float) -> float:
    """Continued fraction of the incomplete beta function, from the front, by Lentz's method."""
    c, d = 1.0, 1.0 - (a + b) * x / (a + 1.0)
    d = 1.0 / (d if abs(d) > _LEAST_DIVISOR else _LEAST_DIVISOR)
    value = d
    for m in range(1, _MAX_TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        change = 1.0
        for part in (even, odd):
            d, c = 1.0 + part * d, 1.0 + part / c
            d = 1.0 / (d if abs(d) > _LEAST_DIVISOR else _LEAST_DIVISOR)
            c = c if abs(c) > _LEAST_DIVISOR else _LEAST_DIVISOR
            change = d * c
            value *= change
        if abs(change - 1.0) <= _EPS:
            break
    return value


@compiled
def log_f_survival(f: float, numerator_dof: int, denominator_dof: int) -> float:
    r"""Logarithm of the probability that an F-distributed number exceeds f.

    $$\ln P = \ln I_x(a, b), \qquad a = d_2 / 2,\ b = d_1 / 2,\ x = d_2 / (d_2 + d_1 f)$$

    by its continued fraction, times its front factor as a logarithm, so that nothing underflows; where x is beyond
    the middle, by that of 1 - x.

    Parameters
    ----------
    f : float
        Ratio, >= 0.
    numerator_dof, denominator_dof : int
        d1 and d2, >= 1.

    Returns
    -------
    log_p : float
        Natural logarithm, <= 0; about -1e5 is as exact as -1.

    References
    ----------
    .. [1] NIST Digital Library of Mathematical Functions, after section 8.17 (incomplete beta functions).
    .. [2] W. J. Lentz, Generating Bessel functions in Mie scattering calculations using continued fractions, Applied
       Optics 15, 1976.

    Examples
    --------
    >>> round(log_f_survival(10.0, 2, 60), 9), round(-30 * math.log1p(10.0 / 30.0), 9)
    (-8.630462174, -8.630462174)
    >>> round(log_f_survival(1e9, 3, 6000), 3)
    -39362.972
    """
    if f <= 0.0:
        return 0.0
    a, b = denominator_dof / 2.0, numerator_dof / 2.0
    w = a / (b * f)
    x = w / (1.0 + w)
    log_front = -a * math.log1p(1.0 / w) - b * math.log1p(w) - _log_beta(a, b)
    if x < (a + 1.0) / (a + b + 2.0):
        return log_front - math.log(a) + math.log(_fraction(a, b, x))
    return math.log1p(-math.exp(log_front - math.log(b)) * _fraction(b, a, 1.0 / (1.0 + w)))
