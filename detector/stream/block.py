"""Blocks of samples as plain arrays, in which compiled code takes them: rows of a recording, or one live sample."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wetwell.detector.stream.gate import CONFIRMATIONS
from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.messages.readings import Readings, row_values
from wetwell.protocols.quantities import columns_of
from wetwell.protocols.recordings.recording import Recording

BLOCK_ROWS = 4096
MISSING_STEPS = 1.5
"""Rows of a recording that lie further apart than so many of its usual steps have others missing between them."""


class Block(NamedTuple):
    """Samples of one station.

    Attributes
    ----------
    time_ns, seq : (n,) int64
    values : (n, 2 + 5 pumps) array
        Level, inflow, then frequency, flow, head, power and running (0 or more) of each pump; NaN is "no value".
    is_switched : (n, pumps) bool
        Whether a pump may have started or stopped within the interval that a value is the mean of.
    is_confirmed : (n,) bool
        Whether the samples that come next confirm a stamp, however far ahead it lies; live none is known.
    pumps : int
        How many pumps the source speaks of.
    is_bad : bool
        Whether the source calls all of them bad.
    """

    time_ns: Integers
    seq: Integers
    values: Floats
    is_switched: Flags
    is_confirmed: Flags
    pumps: int
    is_bad: bool

    def in_one_piece(self) -> "Block":
        """The block, each array of it in one piece of memory, as compiled code takes them."""
        return self._replace(
            time_ns=np.ascontiguousarray(self.time_ns, dtype=np.int64),
            seq=np.ascontiguousarray(self.seq, dtype=np.int64),
            values=np.ascontiguousarray(self.values, dtype=np.float64),
            is_switched=np.ascontiguousarray(self.is_switched, dtype=np.bool_),
            is_confirmed=np.ascontiguousarray(self.is_confirmed, dtype=np.bool_),
        )


def blocks(recording: Recording, pumps: int) -> Iterator[Block]:
    """Yield the rows of a recording for a station with so many pumps, `seq` counting from 0."""
    columns = [recording.column(name) for name in columns_of(pumps)]
    is_switched, is_confirmed = switched_rows(recording, pumps), confirmed_rows(recording.time_ns)
    for first in range(0, len(recording), BLOCK_ROWS):
        last = min(first + BLOCK_ROWS, len(recording))
        values = np.empty((last - first, len(columns)))
        for number, column in enumerate(columns):
            values[:, number] = column[first:last]
        time_ns, seq = np.array(recording.time_ns[first:last]), np.arange(first, last)
        flags = np.array(is_switched[first:last]), is_confirmed[first:last]
        yield Block(time_ns, seq, values, *flags, recording.pumps, False)


def switched_rows(recording: Recording, pumps: int) -> Flags:
    """(n, pumps) whether a pump may have been switched in the interval of a row; never where values are no means.

    A pump that runs in a row, and not in the one before or in the one after, was switched within it, or no one knows:
    a row at the edge of a gap is one of them.
    """
    switched = np.zeros((len(recording), pumps), dtype=bool)
    if recording.value != "mean" or len(recording) == 0:
        return switched
    order = np.argsort(recording.time_ns, kind="stable")
    flag, frequency_hz, flow_m3h = (
        recording.of_pumps(name, pumps)[:, order] for name in ("running", "frequency_hz", "flow_m3h")
    )
    shown = np.where(np.isnan(flag), np.where(np.isnan(frequency_hz), flow_m3h, frequency_hz), flag)
    is_on = shown > 0.0
    step_ns = np.diff(recording.time_ns[order])
    is_next = (step_ns > 0) & (step_ns < MISSING_STEPS * np.median(step_ns)) if step_ns.size else step_ns > 0
    goes_on = is_on[:, 1:] & is_on[:, :-1] & is_next
    edge = np.zeros((pumps, 1), dtype=bool)
    through = np.hstack((edge, goes_on)) & np.hstack((goes_on, edge))
    switched[order] = (is_on & ~through).T
    return switched


def confirmed_rows(time_ns: Integers) -> Flags:
    """(n,) whether the next rows, as many as a live clock that was set is followed after, all lie behind a row.

    Examples
    --------
    >>> confirmed_rows(np.array([0, 1, 9000, 2, 3])).tolist()
    [True, True, False, True, False]
    """
    beyond = np.full(CONFIRMATIONS - 1, np.iinfo(np.int64).max)
    following = np.lib.stride_tricks.sliding_window_view(np.append(time_ns[1:], beyond), CONFIRMATIONS - 1)
    is_confirmed: Flags = time_ns <= following[: len(time_ns)].min(axis=1)
    is_confirmed[-1:] = False
    return is_confirmed


class LiveBlock:
    """A block of one sample, filled anew for each."""

    def __init__(self, pumps: int) -> None:
        self._time_ns, self._seq = np.zeros((2, 1), dtype=np.int64)
        self._values = np.full((1, len(columns_of(pumps))), np.nan)
        self._is_switched = np.zeros((1, pumps), dtype=bool)
        self._is_confirmed = np.zeros(1, dtype=bool)

    def fill(self, sample: Readings) -> Block:
        """The sample as a block, until the next one is filled in."""
        self._time_ns[0] = sample.time
        self._seq[0] = sample.seq
        values = row_values(sample)
        del values[self._values.shape[1] :]
        self._values[0, : len(values)] = values
        is_bad = sample.quality == "bad"
        flags = self._is_switched, self._is_confirmed
        return Block(self._time_ns, self._seq, self._values, *flags, len(sample.pumps), is_bad)
