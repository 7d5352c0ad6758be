"""How probable the cells are under a set of effects, its parameters and errors of form integrated out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product

import numpy as np
from scipy.linalg import solve
from scipy.special import logsumexp

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.likelihood.cells import RAIN, Block, Cells
from wetwell.sim2real.likelihood.covariance import SWINGS, Covariance, Form, covariance_of, no_form
from wetwell.sim2real.likelihood.jumps import jumping
from wetwell.sim2real.likelihood.rain import log_priors, rainy_cells
from wetwell.sim2real.likelihood.ways import Seen, Ways, right_ways

TRUSTED = 0.01
"""Share of the range of a parameter for which its slopes are taken to hold: the fit minimised another loss. [1]"""
WEIGHINGS = 2
"""Looks at what is wrong: at the fit, and at what is most probable under what was seen there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stirred:
    """A block with a surge of the inflow and its rain, and the error of the course of what swings.

    Attributes
    ----------
    block : Block
    swing : float
    log_rain : float
        What not knowing where it rains, and where the inflow jumps, adds to the logarithm of the probability.
    dry : Block, optional
        The block without its rain, where there is some.
    log_dry : float
        Logarithm of the probability that it is dry in all cycles, and what not knowing the jumps adds.
    """

    block: Block
    swing: float = SWINGS[0]
    log_rain: float = 0.0
    dry: Block | None = None
    log_dry: float = 0.0


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
    gained : float
        By what the step makes the recording likelier than it is at the fit, in the logarithm, if slopes hold.
    precision : (parameters, parameters) array
        Inverse of the covariance of the parameters, over their ranges.
    stirred : tuple of Stirred
        Each block with its likeliest surge and swing.
    needed : (effects,) array
        By how much each effect makes the recording likelier, twice the logarithm, under the same errors and with the
        parameters of the others at their best without it.
    """

    log: float
    by_block: Floats
    residuals: Floats
    step: Floats
    gained: float
    precision: Floats
    stirred: tuple[Stirred, ...]
    needed: Floats


def evidence(
    cells: Cells,
    residuals: Floats,
    slopes: Floats,
    form: Form,
    position: Floats,
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
    position : (parameters,) array
        Of the fit, 0 to 1 over these ranges: none is left.
    members : sequence of Member
        The effects.

    References
    ----------
    .. [1] D. J. C. MacKay, Bayesian interpolation, Neural Computation 4, 1992.
    """
    count = slopes.shape[1]
    columns, step = np.column_stack([residuals, slopes, *(one.absent for one in members)]), np.zeros(count)
    fitted, room = slice(0, 1 + count), np.clip([0.0 - position, 1.0 - position], -TRUSTED, TRUSTED)
    for _ in range(WEIGHINGS if count else 1):
        left = residuals + slopes @ step
        likely = [
            weighed(block, columns[block.rows], left[block.rows], form.chosen(block.rows)) for block in cells.blocks
        ]
        inner = np.sum([products for _, products, _ in likely], axis=0)
        precision, slope = inner[1 : 1 + count, 1 : 1 + count], inner[1 : 1 + count, 0]
        step = _step(precision, slope, room)
    along = np.r_[1.0, step]
    by_block = np.array([log - 0.5 * float(along @ products[fitted, fitted] @ along) for log, products, _ in likely])
    peak = float(along @ inner[fitted, fitted] @ along)
    logs = [
        _of_part(inner[fitted, fitted], fixed, room) + 0.5 * peak
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
        gained=0.5 * (float(inner[0, 0]) - peak),
        precision=precision,
        stirred=tuple(one for _, _, one in likely),
        needed=np.array([_needed(inner, one, 1 + count + k, room, peak) for k, one in enumerate(members)]),
    )


def _step(precision: Floats, slope: Floats, room: Floats) -> Floats:
    """To the most probable parameters in the (2, parameters) room around the fit."""
    step, is_free = np.zeros(slope.size), np.ones(slope.size, dtype=np.bool_)
    inner = precision + np.eye(slope.size) * TRUSTED**-2
    while is_free.any():
        pull = slope[is_free] + inner[np.ix_(is_free, ~is_free)] @ step[~is_free]
        step[is_free] = -solve(inner[np.ix_(is_free, is_free)], pull, assume_a="pos")
        within = np.clip(step, *room)
        if np.array_equal(within, step):
            break
        is_free &= within == step
        step = within
    return step


def _partly(neutral: Mapping[int, float]) -> list[dict[int, float]]:
    """What is neutral where all strengths of an effect act, and where one alone does."""
    alone = [{k: way for k, way in neutral.items() if k != one} for one in neutral]
    return [{}, *alone] if len(neutral) > 1 else [{}]


def _of_part(inner: Floats, fixed: Mapping[int, float], room: Floats) -> float:
    """Logarithm of the integral over the parameters that are not fixed, each at its way from the fit."""
    first = np.zeros(inner.shape[0])
    first[0] = 1.0
    for k, way in fixed.items():
        first[1 + k] = way
    free = [1 + k for k in range(inner.shape[0] - 1) if k not in fixed]
    volume = np.linalg.slogdet(np.eye(len(free)) + inner[np.ix_(free, free)] / (2.0 * np.pi))[1]
    return -0.5 * (_least(inner, first, free, room) + float(volume))


def _needed(inner: Floats, member: Member, column: int, room: Floats, peak: float) -> float:
    """Of an effect whose absence is a column behind those of the parameters."""
    first = np.zeros(inner.shape[0])
    first[0] = first[column] = 1.0
    others = [1 + k for k in range(room.shape[1]) if k not in member.parameters]
    return _least(inner, first, others, room) - peak


def _least(inner: Floats, first: Floats, free: Sequence[int], room: Floats) -> float:
    """Least weighed sum of squares of columns of which some are free, near the fit."""
    slope = inner[free] @ first
    precision = inner[np.ix_(free, free)]
    step = _step(precision, slope, room[:, np.asarray(free, dtype=np.int64) - 1])
    return float(first @ inner @ first + 2.0 * slope @ step + step @ precision @ step)


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """How cells count beside some effects: rows of each block, and their covariance."""

    blocks: tuple[tuple[Integers, Covariance], ...]

    def products(self, columns: Floats) -> Floats:
        """(n, n) products of (cells, n) columns."""
        parts = [covariance.projected(columns[rows])[0] for rows, covariance in self.blocks]
        return np.asarray(np.sum(parts, axis=0), dtype=np.float64)


def cell_weights(found: Evidence, form: Form) -> Weights:
    """How cells count beside the effects of an evidence, of which the form is given."""
    blocks = []
    for one in found.stirred:
        rows = one.block.rows
        seen = Seen(one.block, found.residuals[rows], form.chosen(rows), one.swing)
        blocks.append((rows, _under(seen, found.residuals[rows, None], right_ways(one.block))[2]))
    return Weights(blocks=tuple(blocks))


def evidence_of_none(cells: Cells, residuals: Floats) -> Evidence:
    """Evidence without any effect."""
    return evidence(cells, residuals, np.zeros((residuals.size, 0)), no_form(cells), np.zeros(0))


def weighed(
    block: Block, columns: Floats, residuals: Floats, form: Form, ways: Ways | None = None
) -> tuple[float, Floats, Stirred]:
    """A block under what is likeliest to be wrong in it.

    Parameters
    ----------
    block : Block
    columns : (k, n) array
        Of which products are made.
    residuals : (k,) array
        By which it is seen what is wrong.
    form : Form
        Of the block's cells.
    ways : Ways, optional
        What may be wrong; by default as in a right model.

    Returns
    -------
    log, products, stirred : float, (n, n) array, Stirred
        Logarithm of volume and of what not knowing the ways adds, the products of the columns, and the likeliest
        surge and swing.
    """
    tried, ways = [], ways or right_ways(block)
    rained = [_rained_on(replace(block, surge=surge), residuals) for surge in block.surges]
    for still, swing in product(rained, SWINGS if np.any(form.swinging) else SWINGS[:1]):
        one = replace(still, swing=swing)
        log, products = under(Seen(one.block, residuals, form, swing), columns, ways)
        tried.append((one.log_rain + log, products, one))
    totals = np.array([log - 0.5 * float(products[0, 0]) for log, products, _ in tried])
    best = int(np.argmax(totals))
    log, products, stirred = tried[best]
    unsure = float(logsumexp(totals) - totals[best] - np.log(len(tried)))
    return log + unsure, products, stirred


def under(seen: Seen, columns: Floats, ways: Ways) -> tuple[float, Floats]:
    """Logarithm of volume and of what not knowing the ways adds, and products of columns, under the likeliest ways.

    Parameters
    ----------
    seen : Seen
    columns : (k, n) array
        Of which products are made; the first is what is left.
    ways : Ways
        What may be wrong.
    """
    log, products, _ = _under(seen, columns, ways)
    return log, products


def _under(seen: Seen, columns: Floats, ways: Ways) -> tuple[float, Floats, Covariance]:
    """The same with the covariance under these ways."""
    found = []
    for log_prior, allowance in seen.likeliest(ways):
        covariance = covariance_of(seen.block, seen.form, allowance)
        products, log_det = covariance.projected(columns)
        found.append((log_prior - 0.5 * log_det, products, covariance))
    return max(found, key=lambda one: one[0] - 0.5 * float(one[1][0, 0]))


def _rained_on(block: Block, residuals: Floats) -> Stirred:
    """A block with its likeliest rain, if it may have any."""
    if not block.may_rain:
        return Stirred(block=block)
    block, log_jumps = jumping(block, residuals)
    is_rainy, log_rain = rainy_cells(block, residuals)
    if not is_rainy.any():
        return Stirred(block=block, log_rain=log_rain + log_jumps)
    wet = replace(block, surge=np.where(is_rainy, block.surge + RAIN, block.surge))
    log_dry = float(log_priors(block)[0].sum())
    return Stirred(block=wet, log_rain=log_rain + log_jumps, dry=block, log_dry=log_dry + log_jumps)
