"""How probable the cells are under a set of effects, its parameters and errors of form integrated out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product

import numpy as np
from scipy.linalg import solve
from scipy.special import logsumexp

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import Form, no_form
from wetwell.sim2real.likelihood.stirred import Stirred, weighed

TRUSTED = 0.01
"""Share of the range of a parameter for which its slopes are taken to hold: half of the cycles were fitted. [1]"""
WEIGHINGS = 2
"""Looks at what is wrong: at the fit, and at what is most probable under what was seen there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """An effect of a set.

    Attributes
    ----------
    parameters : (k,) array
        Its parameters, by number.
    neutral : mapping of int to float
        The way from the place of each of its strengths to neutral, over its range: it may have all of them, or one.
    absent : (cells,) array
        Change of the residuals without it, all other parameters as they are.
    """

    parameters: Integers
    neutral: Mapping[int, float]
    absent: Floats


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
    stirred : tuple of Stirred
        Each block with what is likeliest to be wrong in it.
    needed : (effects,) array
        By how much each effect makes the recording likelier, twice the logarithm, under the same errors and with the
        parameters of the others at their best without it.
    """

    log: float
    by_block: Floats
    residuals: Floats
    step: Floats
    precision: Floats
    stirred: tuple[Stirred, ...]
    needed: Floats


def evidence(
    cells: Cells,
    residuals: Floats,
    slopes: Floats,
    form: Form,
    members: Sequence[Member] = (),
) -> Evidence:
    r"""Laplace's approximation around a fit.

    $$\ln p(z \mid S) = \sum_b \ln p(r_b \mid \text{way}_b) + \ln w - \tfrac12 \ln\det(1 + H / 2\pi),
    \qquad H = \sum_b J_b^T C_b^{-1} J_b$$

    with the residuals r at the best parameters, their slopes J, a prior that is even over the range of each
    parameter, and in each block b the likeliest way to be wrong, and surge of the inflow, by what the fit leaves; w
    is what the sum over all of them adds, each with its probability.

    Parameters
    ----------
    cells : Cells
    residuals : (cells,) array
        At the fit.
    slopes : (cells, parameters) array
        Change of the residuals over the range of each parameter, at the fit.
    form : Form
    members : sequence of Member
        The effects.

    References
    ----------
    .. [1] D. J. C. MacKay, Bayesian interpolation, Neural Computation 4, 1992.
    """
    count = slopes.shape[1]
    columns = np.column_stack([residuals, slopes, *(one.absent for one in members)])
    best = step = np.zeros(count)
    fitted = slice(0, 1 + count)
    for _ in range(WEIGHINGS if count else 1):
        left = residuals + slopes @ step
        likely = [
            weighed(block, columns[block.rows], left[block.rows], form.chosen(block.rows)) for block in cells.blocks
        ]
        inner = np.sum([products for _, products, _ in likely], axis=0)
        precision, slope = inner[1 : 1 + count, 1 : 1 + count], inner[1 : 1 + count, 0]
        best = _step(precision, slope)
        step = _trusted(best)
    near, along = np.r_[1.0, step], np.r_[1.0, best]
    by_block = np.array([log - 0.5 * float(near @ products[fitted, fitted] @ near) for log, products, _ in likely])
    peak = float(along @ inner[fitted, fitted] @ along)
    logs = [
        _of_part(inner[fitted, fitted], fixed) + 0.5 * peak
        for fixed in (
            dict(chain.from_iterable(one.items() for one in parts))
            for parts in product(*(_partly(one.neutral) for one in members))
        )
    ]
    return Evidence(
        log=float(by_block.sum()) + float(logsumexp(logs)) - float(np.log(len(logs))),
        by_block=by_block,
        residuals=residuals + slopes @ step,
        step=step,
        precision=precision,
        stirred=tuple(one for _, _, one in likely),
        needed=np.array([_needed(inner, one, 1 + count + k, count, peak) for k, one in enumerate(members)]),
    )


def _step(precision: Floats, slope: Floats) -> Floats:
    """To the most probable parameters, by the slopes."""
    if slope.size == 0:
        return np.zeros(0)
    return np.asarray(-solve(precision + np.eye(slope.size) * TRUSTED**-2, slope, assume_a="pos"), dtype=np.float64)


def _trusted(step: Floats) -> Floats:
    """As much of a step as stays where the slopes hold."""
    return step * min(1.0, TRUSTED / max(float(np.abs(step).max(initial=0.0)), TRUSTED))


def _partly(neutral: Mapping[int, float]) -> list[dict[int, float]]:
    """What is neutral where all strengths of an effect act, and where one alone does."""
    alone = [{k: way for k, way in neutral.items() if k != one} for one in neutral]
    return [{}, *alone] if len(neutral) > 1 else [{}]


def _of_part(inner: Floats, fixed: Mapping[int, float]) -> float:
    """Logarithm of the integral over the parameters that are not fixed, each at its way from the fit."""
    first = np.zeros(inner.shape[0])
    first[0] = 1.0
    for k, way in fixed.items():
        first[1 + k] = way
    free = [1 + k for k in range(inner.shape[0] - 1) if k not in fixed]
    volume = np.linalg.slogdet(np.eye(len(free)) + inner[np.ix_(free, free)] / (2.0 * np.pi))[1]
    return -0.5 * (_least(inner, first, free) + float(volume))


def _needed(inner: Floats, member: Member, column: int, count: int, peak: float) -> float:
    """Of an effect whose absence is a column behind those of the `count` parameters."""
    first = np.zeros(inner.shape[0])
    first[0] = first[column] = 1.0
    return _least(inner, first, [1 + k for k in range(count) if k not in member.parameters]) - peak


def _least(inner: Floats, first: Floats, free: Sequence[int]) -> float:
    """Least weighed sum of squares of columns of which some are free, near the fit."""
    slope = inner[free] @ first
    precision = inner[np.ix_(free, free)]
    step = _step(precision, slope)
    return float(first @ inner @ first + 2.0 * slope @ step + step @ precision @ step)


def evidence_of_none(cells: Cells, residuals: Floats) -> Evidence:
    """Evidence without any effect."""
    return evidence(cells, residuals, np.zeros((residuals.size, 0)), no_form(cells))
