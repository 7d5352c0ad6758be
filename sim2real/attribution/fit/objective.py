"""What a fit makes small: the loss of its bins, or the squares of their cells under a covariance."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.evidence import Evidence
from wetwell.sim2real.residuals.asinh_loss import residuals_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective:
    """A sum of squares.

    Attributes
    ----------
    seen : callable
        (k,) what is looked at of (bins,) residuals, as `asinh_loss` makes them.
    products : callable
        (n, n) of (k, n) columns.
    settled, settled_share : float
        Gain, and share of what is left that it may be besides, under which no further step is tried.
    """

    seen: Callable[[Floats], Floats]
    products: Callable[[Floats], Floats]
    settled: float = 0.0
    settled_share: float = 0.0

    def is_settled(self, gain: float, left: float) -> bool:
        """Whether a gain is not worth a step, with so much left."""
        return gain < self.settled + self.settled_share * left


def loss(rows: Flags) -> Objective:
    """The sum of squares of the losses of some bins: what is large counts less."""
    return Objective(
        seen=lambda losses: np.asarray(losses[rows], dtype=np.float64),
        products=lambda columns: np.asarray(columns.T @ columns, dtype=np.float64),
        settled_share=1e-3,
    )


def likely(cells: Cells, found: Evidence, rows: Flags) -> Objective:
    r"""The sum of squares of the cells of some bins, under the covariance that is likeliest at a fit.

    $$\sum_b r_b^T C_b^{-1} r_b$$

    with the residuals r of the blocks b. A gain of 1 is a half in the logarithm of the evidence.

    Parameters
    ----------
    cells : Cells
    found : Evidence
        At the fit; it has the covariance C.
    rows : (bins,) array
        Whole cells.
    """
    is_kept = cells.means(rows.astype(np.float64)) > 0.0
    blocks = [one.within(is_kept) for one in found.stirred]
    return Objective(
        seen=lambda losses: cells.means(residuals_of(losses)),
        products=lambda columns: np.sum([block.products(columns) for block in blocks], axis=0),
        settled=1.0,
    )
