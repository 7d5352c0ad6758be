"""Blocks of samples as plain arrays, in which compiled code takes them: rows of a recording, or one live sample."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.messages.readings import Readings
from wetwell.protocols.recordings.recording import PUMP_QUANTITIES, STATION_COLUMNS, Recording

LEVEL, INFLOW, FIRST_PUMP = 0, 1, 2
"""Values of a row: the two of the station, then five a pump."""
FREQUENCY, FLOW, HEAD, POWER, RUNNING, PUMP_VALUES = 0, 1, 2, 3, 4, 5
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
    names = [*STATION_COLUMNS]
    names += [f"pump{pump}_{quantity}" for pump in range(1, pumps + 1) for quantity in PUMP_QUANTITIES]
    columns = [recording.column(name) for name in names]
    for first in range(0, len(recording), BLOCK_ROWS):
        last = min(first + BLOCK_ROWS, len(recording))
        values = np.empty((last - first, len(names)))
        for number, column in enumerate(columns):
            values[:, number] = column[first:last]
        yield Block(np.array(recording.time_ns[first:last]), np.arange(first, last), values, recording.pumps, False)


class LiveBlock:
    """A block of one sample, filled anew for each."""

    def __init__(self, pumps: int) -> None:
        self._pumps = pumps
        self._time_ns, self._seq = np.zeros((2, 1), dtype=np.int64)
        self._values = np.full((1, FIRST_PUMP + PUMP_VALUES * pumps), np.nan)

    def fill(self, sample: Readings) -> Block:
        """The sample as a block, until the next one is filled in."""
        self._time_ns[0] = sample.time
        self._seq[0] = sample.seq
        values: list[float | None] = [sample.level_m, sample.inflow_m3h]
        for pump in sample.pumps[: self._pumps]:
            values += (pump.frequency_hz, pump.flow_m3h, pump.head_m, pump.power_kw, pump.running)
        self._values[0, : len(values)] = values
        return Block(self._time_ns, self._seq, self._values, len(sample.pumps), sample.quality == "bad")
