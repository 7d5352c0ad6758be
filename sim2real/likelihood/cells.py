"""What the likelihood is of: the mean of the residuals of a group in a cycle."""

from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.residuals.bins import LEVEL, Bins
from wetwell.sim2real.residuals.phases import group_of, phase

SPANS = 32
"""More than there are spans since a regime began."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Means over the bins of one group in one cycle, in the order of the groups; all in units of the bins' deviation.

    A group is a signal of a pump in a regime and condition, in a span of the time since that began; a block is a
    signal in a regime.

    Attributes
    ----------
    of_bin : (bins,) array
        Cell of each bin.
    counts : (cells,) array
        Bins of each cell.
    group, cycle, block : (cells,) arrays
        Numbers from 0.
    first : (groups,) array
        First cell of each group.
    variance : (cells,) array
        Of noise and of what a right model may be off in one cycle.
    material : (cells,) array
        Size under which a difference is none.
    shares_cycle : (cells,) array
        Whether an error of a cycle is common to the cell and others: a level whose inflow nobody measures.
    block_names : tuple of (int, int)
        Signal and regime of each block.
    """

    of_bin: Integers
    counts: Floats
    group: Integers
    cycle: Integers
    block: Integers
    first: Integers
    variance: Floats
    material: Floats
    shares_cycle: Flags
    block_names: tuple[tuple[int, int], ...]

    def means(self, values: Floats) -> Floats:
        """(cells,) means of (bins,) values."""
        return np.asarray(np.bincount(self.of_bin, values, self.counts.size) / self.counts, dtype=np.float64)

    def group_sums(self, values: Floats) -> Floats:
        """(groups, ...) sums of (cells, ...) values."""
        return np.asarray(np.add.reduceat(values, self.first, axis=0), dtype=np.float64)

    @property
    def group_material(self) -> Floats:
        """(groups,) size under which an offset that all cycles share is none."""
        return np.asarray(self.group_sums(self.material) / np.diff(np.r_[self.first, self.group.size]))

    def chosen(self, rows: Integers) -> "Cells":
        """Some of the cells in their order, whole groups; what the bins are is lost."""
        group = np.unique(self.group[rows], return_inverse=True)[1]
        return replace(
            self,
            of_bin=np.zeros(0, dtype=np.int64),
            counts=self.counts[rows],
            group=group,
            cycle=self.cycle[rows],
            block=self.block[rows],
            first=np.flatnonzero(np.diff(group, prepend=-1)),
            variance=self.variance[rows],
            material=self.material[rows],
            shares_cycle=self.shares_cycle[rows],
        )


def cells_of(bins: Bins, condition: Integers, *, has_inflow: bool) -> Cells:
    r"""Cells of the bins of a recording.

    $$\sigma^2 = \overline{f} / n + (1 - \overline{f})$$

    with the share f of a bin's variance that is noise, which its n bins average away, and the rest, which they share.

    Parameters
    ----------
    bins : Bins
    condition : (bins,) array
        As `conditions_of` makes it: what is in another condition is in another group.
    has_inflow : bool
        Whether the inflow is measured.
    """
    key = (condition * (int(group_of(bins).max(initial=0)) + 1) + group_of(bins)) * SPANS + phase(bins)
    groups, group_of_bin = np.unique(key, return_inverse=True)
    cycles = int(bins.cycle.max(initial=0)) + 1
    keys, of_bin = np.unique(group_of_bin * cycles + bins.cycle, return_inverse=True)
    group = keys // cycles
    signal, regime = (
        np.zeros(groups.size, dtype=np.int64) + of_groups
        for of_groups in (_first(group_of_bin, bins.signal), _first(group_of_bin, bins.regime))
    )
    blocks, block = np.unique(signal[group] * len(REGIMES) + regime[group], return_inverse=True)
    counts = np.bincount(of_bin).astype(np.float64)
    noise = np.bincount(of_bin, bins.floor) / counts
    return Cells(
        of_bin=of_bin,
        counts=counts,
        group=group,
        cycle=np.unique(keys % cycles, return_inverse=True)[1],
        block=block,
        first=np.flatnonzero(np.diff(group, prepend=-1)),
        variance=noise / counts + 1.0 - noise,
        material=np.bincount(of_bin, bins.material) / counts,
        shares_cycle=(signal[group] == LEVEL) & (not has_inflow),
        block_names=tuple((int(key) // len(REGIMES), int(key) % len(REGIMES)) for key in blocks),
    )


def _first(group: Integers, values: Integers) -> Integers:
    """(groups,) value of the first member of each group."""
    return values[np.unique(group, return_index=True)[1]]
