"""The rows of a recording on whole seconds: where they lie, what they stand for, and their columns."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.recording.checks import check_rising
from wetwell.sim2real.recording.seconds import filled, repeated

MIN_LENGTH_S = 1800
SLOWEST_S = 900
"""A recording is so long at the least, and from row to row it is so long at the most. [s]"""
MOST_LOST = 10
"""Time that a recording takes over that of its rows at the slowest rate, at the most."""
EACH_SECOND_S = 1.5
"""Seconds from row to row up to which the recording is one of each second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Rows of a recording.

    Attributes
    ----------
    recording : Recording
    second : (rows,) array
        Second of each row. The seconds of a recording of means begin with the interval of its first row.
    rate_s : float
        From row to row, the median. [s]
    span_s : int
        Seconds that a row is the mean of; 1 for instants.
    """

    recording: Recording
    second: Integers
    rate_s: float
    span_s: int

    @property
    def seconds(self) -> int:
        """Length. [s]."""
        return int(self.second[-1]) + 1

    @property
    def is_row(self) -> Flags:
        """(n,) whether there is a row."""
        flags = np.zeros(self.seconds, dtype=np.bool_)
        flags[self.second] = True
        return flags

    @property
    def is_held(self) -> bool:
        """Whether a value stands until another is stored."""
        return self.recording.value == "held"

    def column(self, name: str) -> Floats:
        """(n,) values of a column, NaN between rows."""
        values = np.full(self.seconds, np.nan)
        values[self.second] = self.recording.column(name)
        return values

    def of_pumps(self, quantity: str, pumps: int) -> Floats:
        """(pumps, n) values of a quantity."""
        return np.array([self.column(pump_column(i, quantity)) for i in range(1, pumps + 1)])

    def news(self, values: Floats) -> Floats:
        """(..., n) values without those that only stand: nobody looked again."""
        return np.where(repeated(values), np.nan, values) if self.is_held else values

    def commands(self, station_hz: Floats) -> Floats:
        """(pumps, n) frequencies of the rows, those of running flags where there are none.

        Parameters
        ----------
        station_hz : (pumps,) array
            Nominal ones. [Hz]

        Raises
        ------
        ValueError
            If there is neither.
        """
        pumps = station_hz.size
        frequency_hz = self.of_pumps("frequency_hz", pumps)
        running = self.of_pumps("running", pumps) * station_hz[:, None]
        frequency_hz = np.where(np.isnan(frequency_hz), running, frequency_hz)
        if not np.isfinite(frequency_hz).any():
            raise ValueError("neither frequencies nor running flags have values: no run can be told")
        if self.is_held:
            frequency_hz[:, self.second] = [
                filled(values[self.second], self.second.size, np.nan) for values in frequency_hz
            ]
        return frequency_hz

    def course(self, name: str) -> Floats | None:
        """(n,) values of a column in each second, without NaN; None where most rows have none.

        Of seconds that were lost, and of a value that is held, it is the last one; between rows it goes along a
        straight line; the mean of an interval is that of all its seconds.
        """
        values = self.column(name)
        if self.is_held:
            values = filled(values, self.seconds, np.nan)
        if not np.isfinite(values[self.second]).mean() > 0.5:
            return None
        if self.is_held or self.rate_s <= EACH_SECOND_S:
            return filled(values, self.seconds, 0.0)
        known, place = np.flatnonzero(np.isfinite(values)), np.arange(self.seconds)
        if self.span_s > 1:
            return np.asarray(values[known[np.minimum(np.searchsorted(known, place), known.size - 1)]])
        return np.interp(place, known, values[known])


def rows_of(recording: Recording) -> Rows:
    """Rows of a prepared recording.

    Raises
    ------
    ValueError
        If there are none, times do not rise, or the recording is shorter than half an hour or too slow.
    """
    if len(recording) == 0:
        raise ValueError("the recording has no rows")
    check_rising(recording)
    second = (recording.time_ns - recording.time_ns[0] + NS_PER_S // 2) // NS_PER_S
    seconds = int(second[-1]) + 1
    if seconds < MIN_LENGTH_S:
        raise ValueError(f"the recording is {seconds} s long, a diagnosis needs at least {MIN_LENGTH_S} s")
    rate_s = max(float(np.median(np.diff(second))), 1.0)
    if rate_s > SLOWEST_S or seconds > MOST_LOST * SLOWEST_S * len(second):
        raise ValueError(
            f"the recording has {len(second)} rows over {seconds} s: a stamp is wrong, or it is sampled more slowly "
            f"than every {SLOWEST_S} s"
        )
    span_s = round(rate_s) if recording.value == "mean" else 1
    return Rows(recording=recording, second=second + span_s - 1, rate_s=rate_s, span_s=span_s)
