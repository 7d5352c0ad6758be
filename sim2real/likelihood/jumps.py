"""Jumps of an inflow that nobody measures: learnt from the level at rest, and found where they are likely."""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, log_expit

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.likelihood.cells import Block, Cells, Jumps
from wetwell.sim2real.likelihood.covariance import expected_offset, expected_squares
from wetwell.sim2real.residuals.bins import LEVEL, Bins, allowed_size
from wetwell.sim2real.residuals.phases import settled_at_rest

SOUGHT_FROM = (0.1, 10.0)
"""Variances, over that on average, from which the search begins; half of the cells have each. [1]"""


def with_jumps(cells: Cells, bins: Bins, residuals: Floats) -> Cells:
    r"""The cells with the jumps that the level shows while no pump runs.

    $$\max_{p, v_q, v_j} \sum_k \ln\left[(1 - p)\,p(r_k \mid v_q) + p\,p(r_k \mid v_j)\right]$$

    over the bins k more than `FOLLOWED_S` after the pumps stopped, with the variance v over the average one. No
    pump can be wrong there. There are none where one variance for all is as likely, by Schwarz' criterion.

    Parameters
    ----------
    cells : Cells
    bins : Bins
        Of which they are means.
    residuals : (bins,) array
        Of the station as it is.

    References
    ----------
    G. Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978.
    """
    if not any(block.may_jump for block in cells.blocks):
        return cells
    rows = (bins.signal == LEVEL) & settled_at_rest(bins)
    off = expected_offset(allowed_size(bins.material[rows], bins.floor[rows]))
    jumps = _learnt(residuals[rows] ** 2, bins.floor[rows], off)
    if jumps is None:
        return cells
    return replace(cells, blocks=tuple(replace(one, jumps=jumps) if one.may_jump else one for one in cells.blocks))


def jumping(block: Block, residuals: Floats) -> tuple[Block, float]:
    r"""The block where the inflow jumps most probably, and what not knowing it adds to the logarithm.

    $$\sum_k \ln\left((1 - p)\,p(r_k \mid v_q) + p\,p(r_k \mid v_j)\right) - \ln p(r_k \mid \text{chosen})$$

    Parameters
    ----------
    block : Block
        With the surge that is supposed.
    residuals : (k,) array
    """
    jumps = block.jumps
    if jumps is None:
        return block, 0.0
    quiet, loud = (_log(block, residuals, times) for times in (jumps.quiet, jumps.jumping))
    joint = quiet + np.log1p(-jumps.probability), loud + np.log(jumps.probability)
    jumps_here = joint[1] > joint[0]
    unsure = np.logaddexp(*joint) - np.where(jumps_here, loud, quiet)
    variance = np.where(jumps_here, jumps.jumping, jumps.quiet) * block.variance
    return replace(block, variance=variance), float(unsure.sum())


def _learnt(squares: Floats, variance: Floats, off: Floats) -> Jumps | None:
    """By (n,) squares of residuals, variance of the noise, and what a right model may be off."""

    def log(times: float) -> Floats:
        expected = times * variance + off
        return np.asarray(-0.5 * (squares / expected + np.log(expected)), dtype=np.float64)

    def alike(logs: Floats) -> float:
        return -float(log(np.exp(logs[0])).sum())

    def mixed(logs: Floats) -> float:
        quiet, jumping, odds = logs
        both = log(np.exp(quiet)) + log_expit(-odds), log(np.exp(jumping)) + log_expit(odds)
        return -float(np.logaddexp(*both).sum())

    one = minimize(alike, [0.0], method="Nelder-Mead")
    two = minimize(mixed, [*np.log(SOUGHT_FROM), 0.0], method="Nelder-Mead")
    if one.fun - two.fun <= np.log(max(squares.size, 1)):
        return None
    quiet, jumping = np.sort(np.exp(two.x[:2]))
    odds = two.x[2] if two.x[0] < two.x[1] else -two.x[2]
    return Jumps(probability=float(expit(odds)), quiet=float(quiet), jumping=float(jumping))


def _log(block: Block, residuals: Floats, times: float) -> Floats:
    """(k,) logarithms of the probability of the residuals, the variance as many times the average one."""
    expected = expected_squares(replace(block, variance=times * block.variance)) + block.surge * block.of_inflow
    return np.asarray(-0.5 * (residuals**2 / expected + np.log(expected)), dtype=np.float64)
