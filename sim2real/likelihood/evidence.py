"""How probable the cells are under a set of effects, its parameters and errors of form integrated out."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.likelihood.cells import Block, Cells
from wetwell.sim2real.likelihood.covariance import GOOD, POOR, Allowance, Form, no_form, projected

POORLY = 0.1
"""Probability that a right model is poor in a group. [1]"""
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

    $$\ln p(z \mid S) = \sum_b \ln p(r_b \mid \text{poor}_b) + \ln \pi(\text{poor}) - \tfrac12 \ln\det(1 + H / 2\pi),
    \qquad H = \sum_b J_b^T C_b^{-1} J_b$$

    with the residuals r at the best parameters, their slopes J, a prior that is even over the range of each
    parameter, and in each block b the groups that are poor, and the surges of the inflow, by what the fit leaves; π
    has `POORLY` for each poor group, and the share of a surge.

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
    likely: list[tuple[float, Floats]] = []
    inner = np.zeros((count + 1, count + 1))
    for block in cells.blocks:
        own = form.chosen(block.rows)
        tried = [_weighed(scaled, columns[block.rows], own) for scaled in surging(block)]
        log, products = max(tried, key=lambda one: one[0] - 0.5 * float(one[1][0, 0]))
        likely.append((log - float(np.log(len(tried))), products))
        inner += products
    precision, slope = inner[1:, 1:], inner[1:, 0]
    step = -solve(precision + np.eye(count) * TRUSTED**-2, slope, assume_a="pos") if count else np.zeros(0)
    along = np.r_[1.0, step]
    by_block = np.array([log - 0.5 * float(along @ products @ along) for log, products in likely])
    occam = float(np.linalg.slogdet(np.eye(count) + precision / (2.0 * np.pi))[1])
    return Evidence(
        log=float(by_block.sum()) - 0.5 * occam,
        by_block=by_block,
        residuals=residuals + slopes @ step,
        step=step,
        precision=precision,
    )


def surging(block: Block) -> list[Block]:
    """A block with each surge that there may be."""
    return [replace(block, surge=surge) for surge in block.surges]


def evidence_of_none(cells: Cells, residuals: Floats) -> Evidence:
    """Evidence without any effect."""
    return evidence(cells, residuals, np.zeros((residuals.size, 0)), no_form(cells))


def _weighed(block: Block, columns: Floats, form: Form) -> tuple[float, Floats]:
    """Logarithm of prior and volume of a block, and the products of columns, of which the first are the residuals."""
    is_poor = _poor(block, columns[:, 0], form)
    loose, loose_form = _loosened(block, form, is_poor)
    products, log_det = projected(loose, columns, loose_form, GOOD)
    prior = is_poor.sum() * np.log(POORLY) + (~is_poor).sum() * np.log(1.0 - POORLY)
    return float(prior) - 0.5 * log_det, products


def _poor(block: Block, residuals: Floats, form: Form) -> Flags:
    """(groups,) whether a group is more probable as a poor one, by its mean and its scatter over the cycles."""
    counts = block.group_sums(np.ones(residuals.size))
    mean, noise, allowed, signature = (
        block.group_sums(values) / counts
        for values in (residuals, (1.0 + block.surge) * block.variance, block.allowed**2, form.signature**2)
    )
    scatter = block.group_sums((residuals - mean[block.group]) ** 2)

    def log(allowance: Allowance) -> Floats:
        changing = noise + allowance.change**2 * allowed + allowance.changing_form**2 * signature
        shared = changing / counts + allowance.offset**2 * allowed + allowance.form**2 * signature
        log_volume = np.log(shared) + (counts - 1.0) * np.log(changing)
        return np.asarray(-0.5 * (log_volume + mean**2 / shared + scatter / changing), dtype=np.float64)

    return np.asarray(log(POOR) + np.log(POORLY) > log(GOOD) + np.log(1.0 - POORLY))


def _loosened(block: Block, form: Form, is_poor: Flags) -> tuple[Block, Form]:
    """A block and its form, as if all were good: what is allowed, and what is explained, is larger in poor groups."""
    own = is_poor[block.group]
    allowed = np.where(own, POOR.offset / GOOD.offset, 1.0) * block.allowed
    signature = np.where(own, POOR.form / GOOD.form, 1.0) * form.signature
    return replace(block, allowed=allowed), replace(form, signature=signature)
