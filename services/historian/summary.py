"""Means, least and largest values over spans of time, which can be summed up again over longer ones."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import columns_of, pumps_of_width
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.samples import Samples

MINUTE_NS = 60 * NS_PER_S
TEN_NS = 10 * MINUTE_NS
"""Ten minutes: each complete day is kept as such summaries, too, for questions about long spans."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What the samples of a station were like in spans of time.

    Attributes
    ----------
    time_ns : (n,) int64
        Beginning of each span, rising.
    count : (n, columns) float64
        Number of values; columns as in `columns_of`.
    mean, low, high : (n, columns) float64
        NaN where there is no value.
    """

    time_ns: Integers
    count: Floats
    mean: Floats
    low: Floats
    high: Floats

    def __len__(self) -> int:
        return len(self.time_ns)

    @classmethod
    def of(cls, samples: Samples) -> "Summary":
        """Samples, each as a span of its own."""
        values = samples.values
        count = (~np.isnan(values)).astype(np.float64)
        return cls(time_ns=samples.time_ns, count=count, mean=values, low=values, high=values)

    @classmethod
    def of_rows(cls, rows: Sequence[tuple[int, bytes, bytes, bytes, bytes]]) -> "Summary":
        """Summary of rows (time, count, mean, low, high), float64, of the same or fewer columns."""
        time_ns = np.array([row[0] for row in rows], dtype=np.int64)
        width = max((len(row[1]) // 8 for row in rows), default=2)

        def matrix(arrays: Iterable[bytes], nothing: float) -> Floats:
            values = np.full((len(rows), width), nothing)
            for number, array in enumerate(arrays):
                values[number, : len(array) // 8] = np.frombuffer(array, dtype="<f8")
            return values

        return cls(
            time_ns=time_ns,
            count=matrix((row[1] for row in rows), 0.0),
            mean=matrix((row[2] for row in rows), np.nan),
            low=matrix((row[3] for row in rows), np.nan),
            high=matrix((row[4] for row in rows), np.nan),
        )

    def lists(self) -> Iterator[tuple[int, list[float], list[float], list[float], list[float]]]:
        """Rows (time, count, mean, low, high)."""
        arrays = (self.time_ns, self.count, self.mean, self.low, self.high)
        return zip(*(array.tolist() for array in arrays), strict=True)

    def over(self, start_ns: int, span_ns: int) -> "Summary":
        """Summary over equal spans from `start_ns` on; spans without a row are left out.

        Examples
        --------
        >>> rows = Samples(time_ns=np.arange(4), seq=np.arange(4), quality=np.zeros(4, np.int64),
        ...                values=np.array([[1.0, np.nan], [2.0, 7.0], [3.0, np.nan], [6.0, np.nan]]))
        >>> two = Summary.of(rows).over(0, 2)
        >>> two.time_ns.tolist(), two.mean[:, 0].tolist(), two.high[:, 0].tolist(), two.mean[:, 1].tolist()
        ([0, 2], [1.5, 4.5], [2.0, 6.0], [7.0, nan])
        """
        if not len(self):
            return self
        since = self.time_ns.astype(np.uint64) - np.uint64(start_ns % 2**64)  # cannot overflow, unlike int64
        span = (since // np.uint64(span_ns)).astype(np.int64)
        firsts = np.flatnonzero(np.r_[True, span[1:] != span[:-1]])
        count = np.add.reduceat(self.count, firsts)
        total = np.add.reduceat(np.where(self.count > 0.0, self.mean * self.count, 0.0), firsts)
        return Summary(
            time_ns=np.array([start_ns + number * span_ns for number in span[firsts].tolist()], dtype=np.int64),
            count=count,
            mean=np.where(count > 0.0, total / np.maximum(count, 1.0), np.nan),
            low=np.fmin.reduceat(self.low, firsts),
            high=np.fmax.reduceat(self.high, firsts),
        )

    def select(self, rows: npt.NDArray[np.intp] | Flags) -> "Summary":
        """Some of the spans."""
        return Summary(
            time_ns=self.time_ns[rows],
            count=self.count[rows],
            mean=self.mean[rows],
            low=self.low[rows],
            high=self.high[rows],
        )

    def between(self, start_ns: int, end_ns: int) -> "Summary":
        """Those that begin from `start_ns` until before `end_ns`."""
        return self.select((self.time_ns >= start_ns) & (self.time_ns < end_ns))

    def columns(self) -> dict[str, Floats]:
        """Columns by name: `level_m`, `level_m_min`, `level_m_max`, and so on."""
        names = columns_of(pumps_of_width(self.mean.shape[1]))
        columns: dict[str, Floats] = {}
        for number, name in enumerate(names):
            columns[name] = self.mean[:, number]
            columns[f"{name}_min"] = self.low[:, number]
            columns[f"{name}_max"] = self.high[:, number]
        return columns


def joined(parts: Iterable[Summary]) -> Summary:
    """Summaries that may touch each other, together in the order of time."""
    parts = list(parts)
    width = max((part.mean.shape[1] for part in parts), default=2)

    def stacked(name: str, nothing: float) -> Floats:
        arrays = [getattr(part, name) for part in parts]
        padded = [np.pad(array, ((0, 0), (0, width - array.shape[1])), constant_values=nothing) for array in arrays]
        return np.concatenate([np.empty((0, width)), *padded])[order]

    time_ns = np.concatenate([np.empty(0, dtype=np.int64), *(part.time_ns for part in parts)])
    order = np.argsort(time_ns, kind="stable")
    return Summary(
        time_ns=time_ns[order],
        count=stacked("count", 0.0),
        mean=stacked("mean", np.nan),
        low=stacked("low", np.nan),
        high=stacked("high", np.nan),
    )


def fuller(earlier: Summary, later: Summary) -> Summary:
    """Minutes of two origins: where both have a minute, the one with more values; of equal ones the later."""
    both = joined([later, earlier])
    order = np.lexsort((np.arange(len(both)), -both.count.sum(axis=1), both.time_ns))
    is_first = np.r_[True, np.diff(both.time_ns[order]) > 0]
    return both.select(order[is_first])
