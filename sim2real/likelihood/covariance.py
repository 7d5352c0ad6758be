"""Covariance of the cells: noise, what is material, errors of form, and an inflow that nobody measures."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.likelihood.cells import Cells

CHANGING = 0.5
"""Share of the material size by which a difference may change from cycle to cycle and is still none. [1]"""
SHARED_FORM = 0.05
"""Standard deviation of the error of form of a right effect, as a share of what it explains. [1]"""
CHANGING_FORM = 0.01
"""The same of the part that changes from cycle to cycle. [1]"""
SWING = 0.5
"""The same where an effect is known by how much it swings in time, and not by its course. [1]"""
CYCLE_SCALES = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Standard deviations of an error that a cycle has in common, each as likely as another; in units of `deviation`."""


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


def projected(
    cells: Cells, columns: Floats, form: Form, offset_scale: float = 1.0, cycle_scale: float = 1.0
) -> Iterator[tuple[Floats, float]]:
    r"""Products of columns under the inverse of the covariance, and the logarithm of its determinant.

    $$C = D + \sum_g (m_g^2\, 1_g 1_g^T + s^2\, f_g f_g^T) + \sigma_c^2 \sum_c 1_c 1_c^T, \qquad
    D = \operatorname{diag}(\sigma^2 + (k m)^2 + (s_c f)^2)$$

    with the material size m, the signature f, `CHANGING` k, `SHARED_FORM` s and
    `CHANGING_FORM` $s_c$; groups g are common to all cycles, and
    cycles c to all levels whose inflow nobody measures. One after the other for each of `CYCLE_SCALES` $\sigma_c$, or
    once where no cells share an error.

    Parameters
    ----------
    cells : Cells
    columns : (cells, k) array
    form : Form
    offset_scale, cycle_scale : float
        Times which what is material is allowed: offsets that all cycles share, and what changes between them.

    Returns
    -------
    products, log_determinant : (k, k) array, float

    References
    ----------
    .. [1] W. W. Hager, Updating the inverse of a matrix, SIAM Review 31, 1989 (Woodbury's identity).
    """
    f = form.signature
    variance = (
        cells.variance
        + (cycle_scale * CHANGING * cells.material) ** 2
        + (CHANGING_FORM * f) ** 2
        + (SWING * form.swinging) ** 2
    )
    weight = 1.0 / variance
    offset_variance = (offset_scale * cells.group_material) ** 2
    weighted = columns * weight[:, None]
    sums = cells.group_sums(np.column_stack([weight, weight * f, weight * f**2]))
    ones, both, forms = sums[:, 0] + 1.0 / offset_variance, sums[:, 1], sums[:, 2] + SHARED_FORM**-2
    determinant = ones * forms - both**2
    inverse = np.array([[forms, -both], [-both, ones]]) / determinant
    log_det = float(np.sum(np.log(variance)) + np.sum(np.log(determinant * offset_variance * SHARED_FORM**2)))
    by_group = np.array([cells.group_sums(weighted), cells.group_sums(weighted * f[:, None])])
    products = columns.T @ weighted - _squared(by_group, inverse, by_group)
    rows = np.flatnonzero(cells.shares_cycle)
    if rows.size == 0:
        yield products, log_det
        return
    groups, group = np.unique(cells.group[rows], return_inverse=True)
    cycles, cycle = np.unique(cells.cycle[rows], return_inverse=True)
    of_cycle = np.zeros((2, groups.size, cycles.size))
    of_cycle[0, group, cycle] = weight[rows]
    of_cycle[1, group, cycle] = weight[rows] * f[rows]
    inverse = inverse[:, :, groups]
    inner = np.diag(np.bincount(cycle, weight[rows])) - _squared(of_cycle, inverse, of_cycle)
    crossed = np.zeros((cycles.size, columns.shape[1]))
    np.add.at(crossed, cycle, weighted[rows])
    crossed -= _squared(of_cycle, inverse, by_group[:, groups])
    values, vectors = eigh(inner)
    values, turned = np.maximum(values, 0.0), vectors.T @ crossed
    for scale in CYCLE_SCALES:
        taken = turned / np.sqrt(values + scale**-2)[:, None]
        yield products - taken.T @ taken, log_det + float(np.sum(np.log1p(scale**2 * values)))


def _squared(left: Floats, inverse: Floats, right: Floats) -> Floats:
    """Sum over groups of the products of (2, groups, ...) values under (2, 2, groups) inverses."""
    turned = np.einsum("ijg,jgk->igk", inverse, right)
    return np.asarray(np.tensordot(left, turned, axes=([0, 1], [0, 1])), dtype=np.float64)
