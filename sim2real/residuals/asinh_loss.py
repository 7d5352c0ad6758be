"""The loss of the fits: large residuals count less than their squares."""

import numpy as np

from wetwell.protocols.arrays import Floats

ASINH_SCALE = 5.0


def asinh_loss(residuals: Floats) -> Floats:
    r"""Residuals that a fit squares: $5 \operatorname{asinh}(z / 5)$."""
    return np.asarray(ASINH_SCALE * np.arcsinh(residuals / ASINH_SCALE), dtype=np.float64)


def squares_of(losses: Floats) -> Floats:
    """Squares of the residuals themselves, from what `asinh_loss` made of them.

    Examples
    --------
    >>> squares_of(asinh_loss(np.array([0.0, -20.0]))).round(6)
    array([  0., 400.])
    """
    return np.asarray(residuals_of(losses) ** 2, dtype=np.float64)


def residuals_of(losses: Floats) -> Floats:
    """Residuals themselves, from what `asinh_loss` made of them."""
    return np.asarray(ASINH_SCALE * np.sinh(losses / ASINH_SCALE), dtype=np.float64)


def steepness(losses: Floats) -> Floats:
    """Change of the losses with the residuals themselves: 1 of a small one, less of a large one."""
    return np.asarray(1.0 / np.cosh(losses / ASINH_SCALE), dtype=np.float64)


def weights_of(residuals: Floats) -> Floats:
    r"""Weights by which least squares find the minimum of the squared losses: $w = \ell(r)\,\ell'(r) / r$.

    References
    ----------
    P. W. Holland, R. E. Welsch, Robust regression using iteratively reweighted least-squares, Communications in
    Statistics A 6, 1977.

    Examples
    --------
    >>> weights_of(np.array([0.0, 0.01, -50.0])).round(3)
    array([1.  , 1.  , 0.03])
    """
    losses = asinh_loss(residuals)
    is_small = np.abs(residuals) < 1e-6
    return np.where(is_small, 1.0, losses * steepness(losses) / np.where(is_small, 1.0, residuals))
