"""Samples as the historian gives them back: arrays in the order of time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import columns_of, pumps_of_width
from wetwell.protocols.recordings.recording import Recording
from wetwell.services.historian.rows import PackedSamples, SampleRow, pack_arrays, unpack


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Samples of one station in the order of time and `seq`, each once.

    Attributes
    ----------
    time_ns, seq, quality : (n,) int64
    values : (n, 2 + 5 pumps) float64
        Columns as in `columns_of`; NaN is "no value".
    """

    time_ns: Integers
    seq: Integers
    quality: Integers
    values: Floats

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def pumps(self) -> int:
        """Number of pumps that the columns have room for."""
        return pumps_of_width(self.values.shape[1])

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return columns_of(self.pumps)

    @classmethod
    def of_rows(cls, rows: Sequence[PackedSamples]) -> "Samples":
        """Samples of rows in any order, each once."""
        return merged(
            [
                cls(time_ns=part.time_ns, seq=part.seq, quality=part.quality, values=_finite(part.values))
                for part in unpack(rows)
            ]
        ).in_order()

    @classmethod
    def of_recording(cls, recording: Recording) -> "Samples":
        """Samples of a recording; of the same time the first counts. It has no `seq`: all are 0."""
        columns = [recording.column(name) for name in columns_of(recording.pumps)]
        zeros = np.zeros(len(recording), dtype=np.int64)
        values = np.stack(columns, axis=1) if columns else np.empty((0, 0))
        return cls(time_ns=recording.time_ns, seq=zeros, quality=zeros, values=_finite(values)).in_order()

    def in_order(self) -> "Samples":
        """The same in order, each once."""
        if np.all(_follows(self.time_ns, self.seq)):
            return self
        order = np.lexsort((np.arange(len(self)), self.seq, self.time_ns))
        is_new = np.r_[True, _follows(self.time_ns[order], self.seq[order])] if len(self) else order > 0
        return self.select(order[is_new])

    def select(self, rows: npt.NDArray[np.intp] | Flags | slice) -> "Samples":
        """Some of the rows."""
        return Samples(
            time_ns=self.time_ns[rows], seq=self.seq[rows], quality=self.quality[rows], values=self.values[rows]
        )

    def between(self, start_ns: int, end_ns: int) -> "Samples":
        """Those from `start_ns` until before `end_ns`."""
        first, last = np.searchsorted(self.time_ns, [start_ns, end_ns])
        return self.select(slice(first, last))

    def padded(self, pumps: int) -> Floats:
        """(n, 2 + 5 pumps) values with room for more pumps."""
        missing = len(columns_of(pumps)) - self.values.shape[1]
        return np.pad(self.values, ((0, 0), (0, missing)), constant_values=np.nan) if missing > 0 else self.values

    def recording(self, pumps: int | None = None) -> Recording:
        """As a recording, with at least so many pumps."""
        pumps = max(pumps or 1, self.pumps)
        values = self.padded(pumps)
        return Recording(time_ns=self.time_ns, columns=dict(zip(columns_of(pumps), values.T, strict=True)))

    def rows(self, station: str) -> list[SampleRow]:
        """As packed rows."""
        return pack_arrays(station, self.time_ns, self.seq, self.quality, self.values)


def merged(parts: Sequence[Samples]) -> Samples:
    """Samples of several origins together; of the same time and `seq` that of the earlier part counts."""
    if len(parts) == 1:
        return parts[0]
    pumps = max((part.pumps for part in parts), default=0)
    none = np.empty(0, dtype=np.int64)
    return Samples(
        time_ns=np.concatenate([none, *(part.time_ns for part in parts)]),
        seq=np.concatenate([none, *(part.seq for part in parts)]),
        quality=np.concatenate([none, *(part.quality for part in parts)]),
        values=np.concatenate([np.empty((0, len(columns_of(pumps)))), *(part.padded(pumps) for part in parts)]),
    ).in_order()


def _finite(values: Floats) -> Floats:
    """Infinities mean "no value", too."""
    return np.where(np.isfinite(values), values, np.nan)


def _follows(time_ns: Integers, seq: Integers) -> Flags:
    """(n - 1,) whether each row but the first comes after the one before."""
    is_same = time_ns[1:] == time_ns[:-1]
    follows: Flags = (time_ns[1:] > time_ns[:-1]) | (is_same & (seq[1:] > seq[:-1]))
    return follows
