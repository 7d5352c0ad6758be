"""Blocks of samples as plain arrays, in which compiled code takes them: rows of a recording, or one live sample."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.messages.readings import Readings, row_values
from wetwell.protocols.quantities import columns_of
from wetwell.protocols.recordings.recording import Recording

BLOCK_ROWS = 4096


class Block(NamedTuple):
    """Samples of one station.

    Attributes
    ----------
    time_ns, seq : (n,) int64
    values : (n, 2 + 5 pumps) array
        Level, inflow, then frequency, flow, head, power and running (0 or more) of each pump; NaN is "no value".
    pumps : int
        How many pumps the source speaks of.
    is_bad : bool
        Whether the source calls all of them bad.
    """

    time_ns: Integers
    seq: Integers
    values: Floats
    pumps: int
    is_bad: bool


def blocks(recording: Recording, pumps: int) -> Iterator[Block]:
    """Yield the rows of a recording for a station with so many pumps, `seq` counting from 0."""
    columns = [recording.column(name) for name in columns_of(pumps)]
    for first in range(0, len(recording), BLOCK_ROWS):
        last = min(first + BLOCK_ROWS, len(recording))
        values = np.empty((last - first, len(columns)))
        for number, column in enumerate(columns):
            values[:, number] = column[first:last]
        yield Block(np.array(recording.time_ns[first:last]), np.arange(first, last), values, recording.pumps, False)


class LiveBlock:
    """A block of one sample, filled anew for each."""

    def __init__(self, pumps: int) -> None:
        self._time_ns, self._seq = np.zeros((2, 1), dtype=np.int64)
        self._values = np.full((1, len(columns_of(pumps))), np.nan)

    def fill(self, sample: Readings) -> Block:
        """The sample as a block, until the next one is filled in."""
        self._time_ns[0] = sample.time
        self._seq[0] = sample.seq
        values = row_values(sample)
        del values[self._values.shape[1] :]
        self._values[0, : len(values)] = values
        return Block(self._time_ns, self._seq, self._values, len(sample.pumps), sample.quality == "bad")
