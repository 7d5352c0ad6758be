"""Tail of the F distribution, exact where a p-value underflows."""

import math
from typing import Final

import numpy as np
from scipy.special import betainc, betaincc, betaln

_EPS: Final = float(np.finfo(float).eps)
_UNDERFLOW: Final = 1e-200


def log_f_survival(f: float, numerator_dof: int, denominator_dof: int) -> float:
    r"""Logarithm of the probability that an F-distributed number exceeds f.

    $$\ln P = \ln I_x(a, b), \qquad a = d_2 / 2,\ b = d_1 / 2,\ x = d_2 / (d_2 + d_1 f)$$

    Where the incomplete beta function underflows, its series in $w = x / (1 - x) = d_2 / (d_1 f)$ takes over,

    $$I_x = \frac{x^a (1 - x)^{b - 1}}{a B(a, b)} \Big(1 + \frac{b - 1}{a + 1} w
    + \frac{(b - 1)(b - 2)}{(a + 1)(a + 2)} w^2 + \dots\Big)$$

    whose terms fall by a factor of 200 or more there, so that six of them give full precision at any p.

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
    p = float(betainc(a, b, w / (1.0 + w)))
    if p > 0.5:
        return math.log1p(-float(betaincc(a, b, w / (1.0 + w))))
    if p > _UNDERFLOW:
        return math.log(p)
    term = total = 1.0
    n = 0
    while abs(term) > _EPS * total / 16.0:
        term *= (b - 1.0 - n) * w / (a + 1.0 + n)
        total += term
        n += 1
    log_x, log_complement = -math.log1p(1.0 / w), -math.log1p(w)
    return a * log_x + (b - 1.0) * log_complement - math.log(a) - float(betaln(a, b)) + math.log(total)
