"""Covariance of the cells of a block: noise, what a right model may be off, and errors of form of the effects."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.likelihood.cells import Block, Cells

OFFSET = 0.4
"""Standard deviation of the error of a good model that cycles share, over what is allowed. [1]"""
CHANGING = 0.5
"""Ratio of the part of an error that changes from cycle to cycle to the part that cycles share. [1]"""
GOOD_FORM = 0.07
"""Standard deviation of the error of form of a good effect, as a share of what it explains. [1]"""
POOR_FORM = 0.35
"""The same of a poor one, as in seconds of starts; an error of the model is then as large as is allowed. [1]"""
SWING = 0.5
"""The same where an effect is known by how much it swings in time, and not by its course. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowance:
    """Standard deviations of errors: in units of what is allowed, and as shares of what the effects explain."""

    offset: float
    change: float
    form: float
    changing_form: float


GOOD = Allowance(offset=OFFSET, change=CHANGING * OFFSET, form=GOOD_FORM, changing_form=CHANGING * GOOD_FORM)
POOR = Allowance(offset=1.0, change=CHANGING, form=POOR_FORM, changing_form=CHANGING * POOR_FORM)


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """What the form of the effects may have wrong.

    Attributes
    ----------
    signature : (cells,) array
        What the effects explain, in one number: the root of the sum of squares of what each does.
    swinging : (cells,) array
        Root mean square, within its block, of what those do that swing in time.
    """

    signature: Floats
    swinging: Floats

    def chosen(self, rows: Integers) -> "Form":
        """Of some of the cells."""
        return Form(signature=self.signature[rows], swinging=self.swinging[rows])


def no_form(cells: Cells) -> Form:
    """Where there are no effects."""
    return Form(signature=np.zeros(cells.group.size), swinging=np.zeros(cells.group.size))


def expected_squares(block: Block) -> Floats:
    """(k,) mean squares of the residuals of a good model: noise, and what it may be off."""
    return np.asarray(block.variance + (GOOD.offset**2 + GOOD.change**2) * block.allowed**2, dtype=np.float64)


def projected(block: Block, columns: Floats, form: Form, allowance: Allowance) -> tuple[Floats, float]:
    r"""Products of columns under the inverse of the covariance, and the logarithm of its determinant.

    $$C = \operatorname{diag}\left(\sigma^2 + d^2 + (s_c f)^2\right) + \sum_c v_c v_c^T
    + \tfrac{o^2}{2} \left(a a^T + \sum_g a_g a_g^T\right)
    + \tfrac{s^2}{2} \left(f f^T + \sum_g f_g f_g^T\right), \quad
    d^2 = \tfrac12 \left((c a)^2 + u \sigma^2\right), \quad v^2 = d^2 + (s_w w)^2$$

    with what is allowed a, the surge u, the signature f, what swings w, and the `Allowance` of offset o, change c,
    form s and changing form $s_c$; `SWING` $s_w$; groups g are common to all cycles, and cycles c to all groups.

    Parameters
    ----------
    block : Block
    columns : (k, n) array
    form : Form
        Of the block's cells.
    allowance : Allowance

    Returns
    -------
    products, log_determinant : (n, n) array, float

    References
    ----------
    .. [1] W. W. Hager, Updating the inverse of a matrix, SIAM Review 31, 1989 (Woodbury's identity).
    """
    changing = 0.5 * ((allowance.change * block.allowed) ** 2 + block.surge * block.variance)
    variance = block.variance + changing + (allowance.changing_form * form.signature) ** 2
    in_cycle = np.sqrt(changing + (SWING * form.swinging) ** 2)
    parts = [(block.allowed, allowance.offset)]
    if np.any(form.signature):
        parts.append((form.signature, allowance.form))
    weight = 1.0 / variance
    groups, cycles = int(block.group.max()) + 1, int(block.cycle.max()) + 1
    size = groups * len(parts)
    cycle_weight = 1.0 / (1.0 + block.cycle_sums(weight * in_cycle**2))
    by_cycle = block.cycle_sums(columns * (weight * in_cycle)[:, None])
    products = columns.T @ (columns * weight[:, None]) - by_cycle.T @ (by_cycle * cycle_weight[:, None])
    loaded = np.zeros((cycles, size))
    inner, crossed = np.zeros((size, size)), np.zeros((size, columns.shape[1]))
    log_det = float(np.sum(np.log(variance)) - np.sum(np.log(cycle_weight)))
    for i, (load, deviation) in enumerate(parts):
        own = slice(i * groups, (i + 1) * groups)
        loaded[block.cycle, i * groups + block.group] = weight * in_cycle * load
        crossed[own] = block.group_sums(columns * (weight * load)[:, None])
        for j, (other, _) in enumerate(parts):
            inner[own, j * groups : (j + 1) * groups] += np.diag(block.group_sums(weight * load * other))
        # the inverse of d²/2 (1 + 11ᵀ), of an offset that all groups share and of their own
        inner[own, own] += 2.0 / deviation**2 * (np.eye(groups) - 1.0 / (1.0 + groups))
        log_det += groups * np.log(0.5 * deviation**2) + np.log1p(groups)
    inner -= loaded.T @ (loaded * cycle_weight[:, None])
    crossed -= loaded.T @ (by_cycle * cycle_weight[:, None])
    factor = cho_factor(inner, lower=True)
    log_det += 2.0 * float(np.sum(np.log(np.diag(factor[0]))))
    return np.asarray(products - crossed.T @ cho_solve(factor, crossed), dtype=np.float64), log_det
