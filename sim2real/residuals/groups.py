"""Bins that are summed together, such as those of a signal in a regime, or of a cycle."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers


@dataclass(frozen=True, slots=True, kw_only=True)
class Groups:
    """The rows that are looked at, and the group of each of them.

    Attributes
    ----------
    rows : (bins,) array
    number : (rows,) array
        Group of each row, from 0.
    counts : (groups,) array
        Rows of each group.
    """

    rows: Flags
    number: Integers
    counts: Floats

    def sums(self, values: Floats) -> Floats:
        """(groups,) sums of (bins,) values."""
        return np.bincount(self.number, values[self.rows], self.counts.size).astype(np.float64)

    def means(self, values: Floats) -> Floats:
        """(groups,) means of (bins,) values; 0 of an empty group."""
        return np.asarray(self.sums(values) / np.maximum(self.counts, 1.0), dtype=np.float64)


def groups_of(key: Integers, rows: Flags, size: int = 0) -> Groups:
    """Groups of the rows by a key of all bins; with a size the key is the number of the group.

    Examples
    --------
    >>> groups_of(np.array([7, 3, 7, 9]), np.array([True, True, True, False])).means(np.array([1.0, 2.0, 5.0, 8.0]))
    array([2., 3.])
    """
    number = key[rows] if size else np.unique(key[rows], return_inverse=True)[1]
    return Groups(rows=rows, number=number, counts=np.bincount(number, minlength=size).astype(np.float64))
