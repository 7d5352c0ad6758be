"""How probable the cells are under a set of effects, its parameters and errors of form integrated out."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve
from scipy.special import logsumexp

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import GOOD, POOR, Form, no_form, projected

POORLY = 0.1
"""Probability that a right model is poor in a block. [1]"""
TRUSTED = 0.01
"""Share of the range of a parameter for which its slopes are taken to hold: the fit minimised another loss. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Of a set of effects.

    Attributes
    ----------
    log : float
        Logarithm of the probability of the cells, but for a constant that all sets share.
    by_block : (blocks,) array
        The part of each block, at the most probable parameters.
    residuals : (cells,) array
        At the most probable parameters near the fit.
    step : (parameters,) array
        To these parameters from the fit, over their ranges.
    precision : (parameters, parameters) array
        Inverse of the covariance of the parameters, over their ranges.
    """

    log: float
    by_block: Floats
    residuals: Floats
    step: Floats
    precision: Floats


def evidence(cells: Cells, residuals: Floats, slopes: Floats, form: Form) -> Evidence:
    r"""Laplace's approximation around a fit.

    $$\ln p(z \mid S) = \sum_b \ln \left((1 - w)\,p(r_b \mid \text{good}) + w\,p(r_b \mid \text{poor})\right)
    - \tfrac12 \ln\det(1 + H / 2\pi), \qquad H = \sum_b J_b^T C_b^{-1} J_b$$

    with the residuals r at the best parameters, their slopes J, a prior that is even over the range of each
    parameter, and in each block b the covariance that is more probable at the fit; w is `POORLY`.

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
    columns = np.column_stack([residuals, slopes])
    weighed = ((float(np.log(1.0 - POORLY)), GOOD), (float(np.log(POORLY)), POOR))
    likely: list[list[tuple[float, Floats]]] = []
    inner = np.zeros((count + 1, count + 1))
    for block in cells.blocks:
        own = form.chosen(block.rows)
        each = [(log, *projected(block, columns[block.rows], own, allowance)) for log, allowance in weighed]
        likely.append([(log - 0.5 * log_det, products) for log, products, log_det in each])
        inner += max(likely[-1], key=lambda one: one[0] - 0.5 * float(one[1][0, 0]))[1]
    precision, slope = inner[1:, 1:], inner[1:, 0]
    step = -solve(precision + np.eye(count) * TRUSTED**-2, slope, assume_a="pos") if count else np.zeros(0)
    along = np.r_[1.0, step]
    by_block = np.array(
        [logsumexp([log - 0.5 * float(along @ products @ along) for log, products in each]) for each in likely]
    )
    occam = float(np.linalg.slogdet(np.eye(count) + precision / (2.0 * np.pi))[1])
    return Evidence(
        log=float(by_block.sum()) - 0.5 * occam,
        by_block=by_block,
        residuals=residuals + slopes @ step,
        step=step,
        precision=precision,
    )


def evidence_of_none(cells: Cells, residuals: Floats) -> Evidence:
    """Evidence without any effect."""
    return evidence(cells, residuals, np.zeros((residuals.size, 0)), no_form(cells))
