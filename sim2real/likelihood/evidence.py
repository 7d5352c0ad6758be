"""How probable the cells are under a set of effects, its parameters and errors of form integrated out."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve
from scipy.special import logsumexp

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import SHARED_FORM, Form, no_form, projected

TRUSTED = 0.01
"""Share of the range of a parameter for which its slopes are taken to hold: the fit minimised another loss. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Of a set of effects.

    Attributes
    ----------
    log : float
        Logarithm of the probability of the cells, but for a constant that all sets share.
    residuals : (cells,) array
        At the most probable parameters near the fit.
    """

    log: float
    residuals: Floats


def evidence(cells: Cells, residuals: Floats, slopes: Floats, form: Form) -> Evidence:
    r"""Laplace's approximation around a fit.

    $$\ln p(z \mid S) = -\tfrac12 \left(r^T C^{-1} r + \ln\det C + \ln\det(1 + H / 2\pi)\right), \qquad
    H = J^T C^{-1} J$$

    with the residuals r at the best parameters, their slopes J, and a prior that is even over the range of each
    parameter. C here holds errors of form by block too, $s^2 f_b f_b^T$.

    Parameters
    ----------
    cells : Cells
    residuals : (cells,) array
        At the fit.
    slopes : (cells, parameters) array
        Change of the residuals over the range of each parameter, at the fit.
    form : Form

    References
    ----------
    .. [1] D. J. C. MacKay, Bayesian interpolation, Neural Computation 4, 1992.
    """
    count = slopes.shape[1]
    columns = np.column_stack([residuals, slopes, _by_block(cells, form.signature)])
    best, logs = -np.inf, []
    steps: Floats = np.zeros(count)
    for products, log_volume in projected(cells, columns, form):
        inner, log_det = _integrated(products, log_volume, count + 1, SHARED_FORM**2)
        curvature, slope = inner[1:, 1:], inner[1:, 0]
        step = -solve(curvature + np.eye(count) * TRUSTED**-2, slope, assume_a="pos") if count else np.zeros(0)
        square = float(inner[0, 0] + 2.0 * step @ slope + step @ curvature @ step)
        occam = float(np.linalg.slogdet(np.eye(count) + curvature / (2.0 * np.pi))[1])
        logs.append(-0.5 * (square + log_det + occam))
        if logs[-1] > best:
            best, steps = logs[-1], step
    return Evidence(
        log=float(logsumexp(logs) - np.log(len(logs))),
        residuals=residuals + slopes @ steps,
    )


def evidence_of_none(cells: Cells, residuals: Floats) -> Evidence:
    """Evidence without any effect."""
    return evidence(cells, residuals, np.zeros((residuals.size, 0)), no_form(cells))


def _by_block(cells: Cells, signature: Floats) -> Floats:
    """(cells, blocks) the signature, each block in a column of its own."""
    columns = np.zeros((signature.size, len(cells.block_names)))
    columns[np.arange(signature.size), cells.block] = signature
    return columns[:, np.any(columns != 0.0, axis=0)]


def _integrated(products: Floats, log_det: float, kept: int, variance: float) -> tuple[Floats, float]:
    """Products of the kept columns, and the determinant, with factors of all further columns integrated out."""
    rest = products[kept:, kept:] * variance + np.eye(products.shape[0] - kept)
    if rest.size == 0:
        return products, log_det
    turned = solve(rest, products[kept:, :kept], assume_a="pos") * variance
    inner = products[:kept, :kept] - products[:kept, kept:] @ turned
    return np.asarray(inner, dtype=np.float64), log_det + float(np.linalg.slogdet(rest)[1])
