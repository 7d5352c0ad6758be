"""What of a history can be read by whoever looks at its files alone: of a damaged disk that must not be given up."""

import contextlib
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from wetwell.services.historian.store.live.row_checksum import is_sample_intact

Readable = dict[str, set[tuple[int, int]]]
"""Time and number of samples, by station."""
_ROWS = (
    "SELECT name, s.time_ns, s.seq, s.quality, s.size, s.data, s.station, s.crc "
    "FROM sample AS s JOIN station ON id = s.station"
)
_ORDERS = ("s.station, s.time_ns, s.seq", "s.station DESC, s.time_ns DESC, s.seq DESC")


def readable_in(folder: Path) -> Readable:
    """Samples of a folder that are what was written, whether its historian goes on or begins again.

    One that goes on sees its log as it remembers it; one that begins again only as far as that is whole.
    """
    path = folder / "live.sqlite"
    found = _filed(folder)
    if not path.exists():
        return found
    with tempfile.TemporaryDirectory(dir=folder.parent) as place:
        for suffix in ("", "-wal"):
            with contextlib.suppress(FileNotFoundError):
                shutil.copyfile(f"{path}{suffix}", f"{place}/live.sqlite{suffix}")
        views = [_rows(f"{place}/live.sqlite")]
    if path.with_name("live.sqlite-shm").exists():
        views.append(_rows(f"{path.absolute().as_uri()}?mode=ro"))
    for name, *key in set.intersection(*views):
        found.setdefault(name, set()).add(tuple(key))
    return found


def _rows(place: str) -> set[tuple[str, int, int]]:
    """Samples that can be read from either end of a database."""
    found: set[tuple[str, int, int]] = set()
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(place, uri=True)) as database:
        database.text_factory = lambda content: content.decode(errors="replace")
        for order in _ORDERS:
            with contextlib.suppress(sqlite3.Error):
                for name, time_ns, seq, quality, size, data, station, crc in database.execute(
                    f"{_ROWS} ORDER BY {order}"
                ):
                    if size == 1 and is_sample_intact(station, time_ns, seq, quality, size, data, crc):
                        found.add((name, time_ns, seq))
    return found


def _filed(folder: Path) -> Readable:
    """Samples in daily files that are whole and stand in their place."""
    found: Readable = {}
    for path in sorted(folder.glob("samples/station=*/*.parquet")):
        with contextlib.suppress(OSError, ValueError, KeyError, pa.ArrowException):
            found.setdefault(path.parent.name.removeprefix("station="), set()).update(_stamps(path))
    return found


def _stamps(path: Path) -> Iterator[tuple[int, int]]:
    table = pa.parquet.ParquetFile(path, page_checksum_verification=True).read()
    time_ns = table["time"].cast(pa.int64()).to_numpy()
    is_of_day = (time_ns.astype("datetime64[ns]").astype("datetime64[D]") == np.datetime64(path.stem)).all()
    return zip(time_ns.tolist(), table["seq"].to_pylist(), strict=True) if is_of_day else iter(())
