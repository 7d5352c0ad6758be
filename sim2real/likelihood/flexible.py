"""What no effect of the library does: discrepancies of any size, in any signal and regime."""

from itertools import product

import numpy as np
from scipy.special import logsumexp

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import SHARED_FORM, Form, projected
from wetwell.sim2real.residuals.bins import LEVEL

SCALES = (1.0, 3.0, 10.0, 30.0)
"""Times what is material that an unknown discrepancy may have in a block."""
TOUCHED = 0.3
"""Probability that something unknown is larger than what is material in a block, shared evenly by its scales. [1]"""


def flexible_factor(cells: Cells, residuals: Floats, form: Form) -> float:
    r"""Logarithm of how much more probable the residuals are if something unknown may be in them.

    $$F = \prod_b \frac{\sum_{\lambda, \mu} p(\lambda)\,p(\mu)\,p(r_b \mid \lambda m_g, \mu m)}{p(r_b \mid m_g, m)}$$

    over blocks b, with the scale λ of offsets that all cycles share and μ of what changes between them.

    Parameters
    ----------
    cells : Cells
    residuals : (cells,) array
    form : Form
        Of the effects beside which it acts.
    """
    blocks = [np.flatnonzero(cells.block == block) for block in range(len(cells.block_names))]
    levels = [rows for rows, (signal, _) in zip(blocks, cells.block_names, strict=True) if signal == LEVEL]
    if np.any(cells.shares_cycle):  # an error that they share makes one block of them
        others = [rows for rows, (signal, _) in zip(blocks, cells.block_names, strict=True) if signal != LEVEL]
        blocks = [*others, np.sort(np.concatenate(levels))]
    return float(sum(_factor(cells.chosen(rows), residuals[rows], form.chosen(rows)) for rows in blocks))


def _factor(cells: Cells, residuals: Floats, form: Form) -> float:
    columns = np.column_stack([residuals, form.signature])
    weights = [float(np.log(1.0 - TOUCHED)), *(float(np.log(TOUCHED / (len(SCALES) - 1))) for _ in SCALES[1:])]
    logs: list[float] = []
    for (offset, by_offset), (cycle, by_cycle) in product(zip(SCALES, weights, strict=True), repeat=2):
        each = [_log(products, log_det) for products, log_det in projected(cells, columns, form, offset, cycle)]
        logs.append(float(logsumexp(each)) + by_offset + by_cycle)
    return float(logsumexp(logs) - (logs[0] - 2.0 * weights[0]))


def _log(products: Floats, log_det: float) -> float:
    """Logarithm of the probability, the error of form of the block integrated out."""
    forms = products[1, 1] + SHARED_FORM**-2
    square = products[0, 0] - products[0, 1] ** 2 / forms
    return -0.5 * float(square + log_det + np.log(forms * SHARED_FORM**2))
