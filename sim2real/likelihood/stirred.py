"""A block with what is likeliest to be wrong in it: errors, swings, surges of the inflow, and rain."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import logsumexp

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.likelihood.cells import Block
from wetwell.sim2real.likelihood.covariance import SWINGS, Allowance, Form, projected
from wetwell.sim2real.likelihood.jumps import jumping
from wetwell.sim2real.likelihood.rain import RAIN, log_priors, rainy_cells
from wetwell.sim2real.likelihood.ways import KNOWN, Ways, likeliest


@dataclass(frozen=True, slots=True, kw_only=True)
class Rained:
    """A block with its likeliest rain.

    Attributes
    ----------
    block : Block
    log : float
        What not knowing where it rains adds to the logarithm of the probability.
    dry : Block, optional
        The block without its rain, where there is some.
    log_dry : float
        Logarithm of the probability that it is dry in all cycles.
    """

    block: Block
    log: float = 0.0
    dry: Block | None = None
    log_dry: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stirred:
    """A block with its likeliest surge and rain, error of the course of what swings, and other errors.

    Attributes
    ----------
    rained : Rained
    form : Form
        Of the block's cells.
    allowance : Allowance
    """

    rained: Rained
    form: Form
    allowance: Allowance

    @property
    def block(self) -> Block:
        """With its surge and rain."""
        return self.rained.block

    def products(self, columns: Floats) -> Floats:
        """(n, n) products of (cells, n) columns under the inverse of the covariance."""
        return projected(self.block, columns[self.block.rows], self.form, self.allowance)[0]

    def within(self, is_kept: Flags) -> "Stirred":
        """Of some of all cells only."""
        rows = np.flatnonzero(is_kept[self.block.rows])
        changing = self.allowance.changing
        return Stirred(
            rained=Rained(block=self.block.chosen(rows)),
            form=self.form.chosen(rows),
            allowance=replace(self.allowance, changing=changing.chosen(rows)),
        )


def weighed(
    block: Block, columns: Floats, residuals: Floats, form: Form, ways: Ways = KNOWN
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
    ways : Ways
        What may be wrong.

    Returns
    -------
    log, products, stirred : float, (n, n) array, Stirred
        Logarithm of volume and of what not knowing the ways adds, the products of the columns, and what is likeliest.
    """
    tried = []
    rained = [_rained_on(replace(block, surge=surge), residuals) for surge in block.surges]
    for still, swing in product(rained, SWINGS if np.any(form.swinging) else SWINGS[:1]):
        log_prior, allowance = likeliest(still.block, residuals, form, swing, ways)
        products, log_det = projected(still.block, columns, form, allowance)
        one = Stirred(rained=still, form=form, allowance=allowance)
        tried.append((still.log + log_prior - 0.5 * log_det, products, one))
    totals = np.array([log - 0.5 * float(products[0, 0]) for log, products, _ in tried])
    best = int(np.argmax(totals))
    log, products, stirred = tried[best]
    unsure = float(logsumexp(totals) - totals[best] - np.log(len(tried)))
    return log + unsure, products, stirred


def _rained_on(block: Block, residuals: Floats) -> Rained:
    """A block with its likeliest rain, if it may have any."""
    if not block.may_rain:
        return Rained(block=block)
    block, log_jumps = jumping(block, residuals)
    is_rainy, log_rain = rainy_cells(block, residuals)
    if not is_rainy.any():
        return Rained(block=block, log=log_rain + log_jumps)
    wet = replace(block, surge=np.where(is_rainy, block.surge + RAIN, block.surge))
    log_dry = float(log_priors(block)[0].sum())
    return Rained(block=wet, log=log_rain + log_jumps, dry=block, log_dry=log_dry + log_jumps)
