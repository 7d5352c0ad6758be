"""What of a history can be read by whoever looks at its files alone: of a damaged disk that must not be given up."""

import contextlib
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from itertools import repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from wetwell.protocols.quantities import columns_of, pumps_of
from wetwell.protocols.recordings.origin import Origin
from wetwell.services.historian.store.live.connection import UNREADABLE
from wetwell.services.historian.store.live.row_checksum import is_sample_intact

Row = tuple[str, int, int]
"""Station, time and number of a sample."""
_ROWS = (
    "SELECT name, s.time_ns, s.seq, s.quality, s.size, s.data, s.station, s.last_ns, s.crc "
    "FROM sample AS s JOIN station ON id = s.station"
)
_ORDERS = ("s.station, s.time_ns, s.seq", "s.station DESC, s.time_ns DESC, s.seq DESC")


class Stock(NamedTuple):
    """What a history has.

    Attributes
    ----------
    samples : set of (str, int, int)
        Samples that are what was written.
    messages : set of bytes
        Verdicts, alarms and so on that can be read, changed or not.
    is_whole : bool
        Whether SQLite finds nothing wrong in the database.
    """

    samples: set[Row]
    messages: set[bytes]
    is_whole: bool


def stock_of(folder: Path) -> Stock:
    """Stock of a folder, as its historian sees it: one that goes on knows its log as it remembers it."""
    path = folder / "live.sqlite"
    filed = _filed(folder)
    if not path.exists():
        return Stock(filed, set(), is_whole=True)
    view = _going_on(path) if path.with_name("live.sqlite-shm").exists() else _beginning(path)
    return Stock(filed | view.samples, view.messages, view.is_whole)


def readable_in(folder: Path) -> set[Row]:
    """Samples that can be read whether the historian of a folder goes on or begins again."""
    path = folder / "live.sqlite"
    rows = _beginning(path).samples if path.exists() else set()
    if path.with_name("live.sqlite-shm").exists():
        rows &= _going_on(path).samples
    return _filed(folder) | rows


def _going_on(path: Path) -> "_View":
    return _View(f"{path.absolute().as_uri()}?mode=ro")


def _beginning(path: Path) -> "_View":
    """One who begins again sees the log only as far as that is whole."""
    with tempfile.TemporaryDirectory(dir=path.parent.parent) as place:
        for suffix in ("", "-wal"):
            with contextlib.suppress(FileNotFoundError):
                shutil.copyfile(f"{path}{suffix}", f"{place}/live.sqlite{suffix}")
        return _View(f"{place}/live.sqlite")


class _View:
    """A database as one connection sees it."""

    def __init__(self, place: str) -> None:
        self.samples: set[Row] = set()
        self.messages: set[bytes] = set()
        self.is_whole = False
        with contextlib.suppress(*UNREADABLE), contextlib.closing(sqlite3.connect(place, uri=True)) as database:
            database.text_factory = lambda content: content.decode(errors="replace")
            with contextlib.suppress(*UNREADABLE):
                self.is_whole = database.execute("PRAGMA integrity_check(1)").fetchall() == [("ok",)]
            with contextlib.suppress(*UNREADABLE):
                self.messages.update(payload for (payload,) in database.execute("SELECT payload FROM event"))
            database.execute("PRAGMA writable_schema = ON")  # a trigger that is no SQL any more hides no row
            for order in _ORDERS[: 1 if self.is_whole else 2]:
                with contextlib.suppress(*UNREADABLE):
                    self.samples.update(_intact(database.execute(f"{_ROWS} ORDER BY {order}")))


def _intact(rows: sqlite3.Cursor) -> Iterator[Row]:
    for name, time_ns, seq, quality, size, data, station, last_ns, crc in rows:
        if size == 1 and is_sample_intact(station, time_ns, seq, quality, size, data, last_ns, crc):
            yield name, time_ns, seq


def _filed(folder: Path) -> set[Row]:
    """Samples in daily files that are whole and stand in their place."""
    found: set[Row] = set()
    for path in folder.glob("samples/station=*/*.parquet"):
        station = path.parent.name.removeprefix("station=")
        found |= _rows_of(path.read_bytes(), station, path.stem)
    return found


@lru_cache(maxsize=100)
def _rows_of(content: bytes, station: str, day: str) -> frozenset[Row]:
    """Samples of a daily file; none if it is not that of a station and a day, or a column has lost its name."""
    with contextlib.suppress(OSError, ValueError, KeyError, pa.ArrowException):
        table = pa.parquet.ParquetFile(pa.BufferReader(content), page_checksum_verification=True).read()
        names = set(table.column_names)
        if not names.issuperset({"quality", *columns_of(pumps_of(names))}):
            return frozenset()
        time_ns = table["time"].cast(pa.int64()).to_numpy()
        days = time_ns.astype("datetime64[ns]").astype("datetime64[D]")
        if Origin.of_metadata(table.schema.metadata or {}).station == station and (days == np.datetime64(day)).all():
            return frozenset(zip(repeat(station), time_ns.tolist(), table["seq"].to_pylist()))
    return frozenset()
