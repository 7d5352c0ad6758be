"""What no effect of the library does: discrepancies of any size, in any signal and regime."""

from dataclasses import replace
from itertools import chain, product

import numpy as np
from scipy.special import logsumexp

from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import CHANGING, POOR, Allowance, Form, projected
from wetwell.sim2real.likelihood.evidence import Evidence, surging

SCALES = (3.0, 10.0, 30.0)
"""Times what is allowed that something unknown may be in a block, each as likely."""


def flexible_factor(cells: Cells, found: Evidence, form: Form) -> float:
    r"""Logarithm of how much more probable the residuals are if something unknown may be in them.

    $$F = \prod_b \frac{\tfrac12\,p(r_b) + \tfrac12 \sum_k p_k\, p(r_b \mid \lambda_k, \mu_k)}{p(r_b)}$$

    over blocks b, with λ times what is allowed of offsets that all cycles share, and μ of what changes between them:
    one of them, or both alike.

    Parameters
    ----------
    cells : Cells
    found : Evidence
    form : Form
        Of the effects beside which it acts.
    """
    allowances = list(chain.from_iterable(_unknown(scale) for scale in SCALES))
    total = 0.0
    for block, known in zip(cells.blocks, found.by_block, strict=True):
        residuals, own = found.residuals[block.rows, None], form.chosen(block.rows)
        logs = []
        for scaled, allowance in product(surging(block), allowances):
            products, log_det = projected(scaled, residuals, own, allowance)
            logs.append(-0.5 * (float(products[0, 0]) + log_det))
        unknown = float(logsumexp(logs)) - np.log(len(logs))
        total += float(np.logaddexp(known, unknown) - np.log(2.0) - known)
    return total


def _unknown(scale: float) -> tuple[Allowance, ...]:
    """Offsets of a scale, changes of it, and both."""
    offset, change = replace(POOR, offset=scale), replace(POOR, change=CHANGING * scale)
    return offset, change, replace(offset, change=change.change)
