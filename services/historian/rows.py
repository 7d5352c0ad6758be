"""Rows of one or more samples of a station, packed: what goes to a store, and what a live database holds."""

import itertools
import struct
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.messages.readings import Readings, row_values
from wetwell.protocols.messages.sample import Quality
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.timestamps import NS_PER_S

HOUR_NS = 3600 * NS_PER_S

QUALITIES: tuple[str, ...] = get_args(Quality)
"""A sample's quality is kept as its place in here."""

MAX_DATA_BYTES = 950
"""Of a row of several samples: SQLite gives a longer one a page of its own; its file is then 2.5 times as large."""

_NAN = float("nan")


class SampleRow(NamedTuple):
    """One or more samples of a station: of one quality, within an hour in UTC, and their times never fall.

    Attributes
    ----------
    time_ns, seq : int
        Of the first sample.
    size : int
        Number of samples.
    last_ns : int
        Time of the last sample.
    data : bytes
        (size, 2 + 5 pumps) float64, the values of each sample in the order of `columns_of`; if there are several
        samples then (size,) int64 with their times and (size,) int64 with their `seq`. All little-endian.
    """

    station: str
    time_ns: int
    seq: int
    size: int
    last_ns: int
    quality: int
    data: bytes


PackedSamples = tuple[int, int, int, int, bytes]
"""Of a `SampleRow` what its samples can be told from: `time_ns`, `seq`, `size`, `quality`, `data`."""


class UnpackedSamples(NamedTuple):
    """Samples of rows that are alike, in their order; `row` says for each sample from which row it is."""

    row: npt.NDArray[np.intp]
    time_ns: Integers
    seq: Integers
    quality: Integers
    values: Floats


def pack(station: str, sample: Readings) -> SampleRow:
    """Row of a sample; what has no value is NaN."""
    values = row_values(sample)
    data = _packer(len(values)).pack(*[_NAN if value is None else value for value in values])
    return SampleRow(station, sample.time, sample.seq, 1, sample.time, QUALITIES.index(sample.quality), data)


def pack_block(block: SampleBlock) -> list[SampleRow]:
    """Rows of a block; of the same block always the same."""
    time_ns, seq = np.array(block.time, dtype=np.int64), np.array(block.seq, dtype=np.int64)
    quality = np.full(len(seq), QUALITIES.index(block.quality))
    return pack_arrays(block.station, time_ns, seq, quality, block.values())


def pack_arrays(station: str, time_ns: Integers, seq: Integers, quality: Integers, values: Floats) -> list[SampleRow]:
    """Rows of (n,) samples with (n, 2 + 5 pumps) values, split where a row must end, and then evenly."""
    if not len(time_ns):
        return []
    most = max(1, MAX_DATA_BYTES // (8 * (values.shape[1] + 2)))
    hour = time_ns // HOUR_NS
    is_end = (time_ns[1:] < time_ns[:-1]) | (hour[1:] != hour[:-1]) | (quality[1:] != quality[:-1])
    data, keys = values.astype("<f8"), np.stack([time_ns, seq]).astype("<i8")
    times, seqs, qualities = time_ns.tolist(), seq.tolist(), quality.tolist()
    rows = []
    for begin, end in itertools.pairwise([0, *(np.flatnonzero(is_end) + 1).tolist(), len(times)]):
        parts = -(-(end - begin) // most)
        cuts = [begin + (end - begin) * part // parts for part in range(parts + 1)]
        for first, last in itertools.pairwise(cuts):
            packed = data[first:last].tobytes() + (keys[:, first:last].tobytes() if last - first > 1 else b"")
            rows.append(
                SampleRow(station, times[first], seqs[first], last - first, times[last - 1], qualities[first], packed)
            )
    return rows


def unpack(rows: Sequence[PackedSamples]) -> Iterator[UnpackedSamples]:
    """Samples of rows, those of the same size and number of pumps together."""
    alike: dict[tuple[int, int], list[int]] = defaultdict(list)
    for number, row in enumerate(rows):
        alike[row[2], len(row[4])].append(number)
    for (size, length), numbers in sorted(alike.items()):
        several = [rows[number] for number in numbers]
        words = np.frombuffer(b"".join([row[4] for row in several]), dtype="<f8").reshape(len(several), length // 8)
        quality = np.array([row[3] for row in several], dtype=np.int64)
        if size == 1:
            keys = np.array([row[:2] for row in several], dtype=np.int64)
            yield UnpackedSamples(np.array(numbers), keys[:, 0], keys[:, 1], quality, words)
        else:
            keys = words[:, -2 * size :].view("<i8")
            yield UnpackedSamples(
                np.repeat(numbers, size),
                keys[:, :size].ravel(),
                keys[:, size:].ravel(),
                np.repeat(quality, size),
                words[:, : -2 * size].reshape(len(several) * size, -1),
            )


@lru_cache
def _packer(values: int) -> struct.Struct:
    return struct.Struct(f"<{values}d")
