"""Means of the residuals of a group in a cycle, and what a right model may leave of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_array

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.likelihood.covariance import DIFFERING, GOOD_FORM, POOR_FORM
from wetwell.sim2real.recording.regimes import START_RAMP, STOP_RAMP
from wetwell.sim2real.residuals.bins import Bins, allowed_size
from wetwell.sim2real.residuals.phases import group_of, phase


@dataclass(frozen=True, slots=True, kw_only=True)
class Means:
    r"""Cells: one group (signal, pump, regime, span of time since it began) in one cycle.

    $$C = \operatorname{diag}\left(\overline{f} / n + 1 - \overline{f} + (k\,m)^2\right)
    + \sum_g \left(m_g^2 + (s\,r_g)^2\right) 1_g 1_g^T$$

    with the share f of a bin's variance that is noise, its n bins, and the material size m, of which the share
    `DIFFERING` k may change from cycle to cycle: an offset of a group g that all cycles share is none while it is
    small. Nor is it one while it is small beside what there is to explain, the median r_g of the residuals without a
    correction: the form of a right one is wrong by the share s of that, `GOOD_FORM`, or `POOR_FORM` in starts and
    stops.

    Attributes
    ----------
    of_bin : (bins,) array
        Cell of each bin.
    counts : (cells,) array
        Bins of each cell.
    group : (cells,) array
        From 0.
    weight : (cells,) array
        Inverse of the diagonal.
    allowed : (cells,) array
        What a right model may be off, as of `likelihood.cells.Cells`.
    group_material : (groups,) array
        m_g.
    group_wrong : (groups,) array
        What all cycles of a group may share: m_g with what the form may have wrong.
    """

    of_bin: Integers
    counts: Floats
    group: Integers
    weight: Floats
    allowed: Floats
    group_material: Floats
    group_wrong: Floats

    def of(self, columns: Floats, factor: float | Floats = 1.0) -> Floats:
        """(cells, k) means of (bins, k) columns, each times a factor, or (bins,) factors."""
        return _sums(self.of_bin, self.counts.size, factor) @ columns / self.counts[:, None]

    def middle(self, residuals: Floats) -> Floats:
        """(bins,) median of the residuals of the group that a bin is of."""
        of_bin = self.group[self.of_bin]
        return np.asarray(ndimage.median(residuals, of_bin, np.arange(self.group_material.size))[of_bin])

    def of_groups(self, columns: Floats) -> Floats:
        """(bins, k) means of (bins, k) columns over the group that a bin is of."""
        of_bin = self.group[self.of_bin]
        count = np.bincount(of_bin)
        return np.array([(np.bincount(of_bin, column) / count)[of_bin] for column in columns.T]).T

    def without(self, cells: Flags) -> "Means":
        """The means, but some cells say nothing."""
        return replace(self, weight=np.where(cells, 0.0, self.weight))

    def weighed(self, columns: Floats) -> Floats:
        """(cells, k) columns times the inverse of C, by Woodbury's identity."""
        weighted = columns * self.weight[:, None]
        ones = np.bincount(self.group, self.weight) + self.group_wrong**-2
        alike = (_sums(self.group, self.group_wrong.size) @ weighted) / ones[:, None]
        return np.asarray(weighted - self.weight[:, None] * alike[self.group], dtype=np.float64)

    def products(self, columns: Floats) -> Floats:
        """(k, k) products of (cells, k) columns under the inverse of C."""
        return np.asarray(columns.T @ self.weighed(columns), dtype=np.float64)

    def matters(self, signature: Floats) -> bool:
        """Whether (bins,) changes of the residuals are more than what is material, in some group."""
        squares = np.bincount(self.group, self.of(signature[:, None])[:, 0] ** 2) / np.bincount(self.group)
        return bool(np.any(squares > self.group_material**2))

    def are_alike(self, one: Floats, other: Floats) -> bool:
        """Whether two (bins,) changes of the residuals are one for all that a right model may have wrong.

        They differ in no group by more than what is allowed, and than a good form has wrong of either.
        """
        first, second = self.of(np.column_stack([one, other])).T
        wrong = self.allowed**2 + 2.0 * GOOD_FORM**2 * np.maximum(first**2, second**2)
        return bool(np.all(np.bincount(self.group, (first - second) ** 2) <= np.bincount(self.group, wrong)))


def _sums(places: Integers, size: int, factor: float | Floats = 1.0) -> csr_array:
    """(size, n) matrix that sums what is in each place, each times a factor, or (n,) factors."""
    count = places.size
    return csr_array((np.broadcast_to(factor, count), (places, np.arange(count))), (size, count))


def means_of(bins: Bins, plain: Floats) -> Means:
    """Cells of the bins of a recording, of which `plain` (bins,) are the residuals without a correction."""
    spans = int(phase(bins).max(initial=0)) + 1
    group_of_bin = np.unique(group_of(bins) * spans + phase(bins), return_inverse=True)[1]
    cycles = int(bins.cycle.max(initial=0)) + 1
    keys, of_bin = np.unique(group_of_bin * cycles + bins.cycle, return_inverse=True)
    group, counts = keys // cycles, np.bincount(of_bin).astype(np.float64)
    noise, material = (np.bincount(of_bin, values) / counts for values in (bins.floor, bins.material))
    is_ramp = np.isin(bins.regime, (START_RAMP, STOP_RAMP))
    form = np.where(np.bincount(group_of_bin, is_ramp) > 0.0, POOR_FORM, GOOD_FORM)
    group_material = np.maximum(np.bincount(group, material) / np.bincount(group), LEAST_MATERIAL)
    middle = ndimage.median(plain, group_of_bin, np.arange(group_material.size))
    return Means(
        of_bin=of_bin,
        counts=counts,
        group=group,
        weight=1.0 / (noise / counts + 1.0 - noise + (DIFFERING * material) ** 2),
        allowed=allowed_size(material, noise),
        group_material=group_material,
        group_wrong=np.hypot(group_material, form * middle),
    )


LEAST_MATERIAL = 1e-3
"""Material size at the least, in units of noise: nothing is told better than that. [1]"""
