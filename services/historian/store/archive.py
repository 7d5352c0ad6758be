"""Days that are complete, a Parquet file each: `samples/station=alpha/2026-11-20.parquet`; others likewise.

A file of samples is a recording with two more columns, `seq` and `quality`; it carries its station. In `minutes/` a
day of which only minutes are left has columns by name. In `tens/` each day has a summary of its ten minutes: five
columns, of which four are lists as long as `columns_of`, so that a file is read in .4 ms and not in 2.5.
"""

import logging
import os
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.quantities import columns_of, pumps_of, pumps_of_width
from wetwell.protocols.recordings.origin import Origin
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store.day_ledger import DayLedger
from wetwell.services.historian.store.interface import DAY_NS, StoreError
from wetwell.services.historian.summary import Summary

log = logging.getLogger(__name__)

SETTLE_S = 1.0
"""So long a file and the line about it may be apart. [s]"""
Form = Literal["samples", "minutes", "tens"]
_STAMP = pa.timestamp("ns", tz="UTC")
_SUMMARY = ("count", "mean", "low", "high")
_FEW_VALUES = ("running", "count", "quality")
"""Endings of columns that repeat a few values; the others are measured, and take a third less as streams of bytes."""


class DamagedDayError(StoreError):
    """The file of a day cannot be read, or is not what was written.

    Parameters
    ----------
    text : str
    form, station, day_ns
        Of the file, as `Archive.path` takes them.
    """

    def __init__(self, text: str, form: Form, station: str, day_ns: int) -> None:
        super().__init__(text)
        self.form = form
        self.station = station
        self.day_ns = day_ns


class Archive:
    """A folder of daily files. Every method raises `StoreError` if it cannot now, and names the file."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._ledger = DayLedger(folder)

    def stations(self) -> list[str]:
        """Stations of which there is a file."""
        folders = [folder for form in ("samples", "minutes") for folder in self._folder.glob(f"{form}/station=*")]
        return sorted({folder.name.removeprefix("station=") for folder in folders})

    def days_ns(self, form: Form, station: str) -> list[int]:
        """Days of which there is a file, by their beginnings. [ns]."""
        names = [path.stem for path in (self._folder / form / f"station={station}").glob("*.parquet")]
        return sorted(int(np.datetime64(name, "ns").astype(np.int64)) for name in names if not name.startswith("."))

    def path(self, form: Form, station: str, day_ns: int) -> Path:
        """Where the file of a day is."""
        day = np.datetime_as_string(np.datetime64(day_ns, "ns"), unit="D")
        return self._folder / form / f"station={station}" / f"{day}.parquet"

    def samples(self, station: str, day_ns: int) -> Samples | None:
        """Samples of a day; None if there is no file."""
        table = self._read("samples", station, day_ns)
        if table is None:
            return None
        return Samples(
            time_ns=_stamps(table),
            seq=_numbers(table["seq"]),
            quality=_numbers(table["quality"]).astype(np.int64),
            values=_matrix(table, columns_of(pumps_of(table.column_names))),
        )

    def pumps(self, station: str, day_ns: int) -> int:
        """Number of pumps in the file of a day; 0 if there is none."""
        try:
            return pumps_of(pa.parquet.read_schema(self.path("samples", station, day_ns)).names)
        except FileNotFoundError:
            return 0
        except (OSError, pa.ArrowException) as error:
            raise StoreError(f"{self.path('samples', station, day_ns)}: cannot be read: {error}") from error

    def count(self, station: str, day_ns: int, start_ns: int, end_ns: int) -> int:
        """Number of samples of a span in the file of a day; 0 if there is none."""
        table = self._read("samples", station, day_ns, ["time"])
        if table is None:
            return 0
        time_ns = _stamps(table)
        return int(np.count_nonzero((time_ns >= start_ns) & (time_ns < end_ns)))

    def minutes(self, station: str, day_ns: int) -> Summary | None:
        """Minutes of a day; None if there is no file."""
        table = self._read("minutes", station, day_ns)
        if table is None:
            return None
        names = columns_of(pumps_of(table.column_names))
        return Summary(
            time_ns=_stamps(table),
            count=_matrix(table, [f"{name}_count" for name in names]),
            mean=_matrix(table, names),
            low=_matrix(table, [f"{name}_min" for name in names]),
            high=_matrix(table, [f"{name}_max" for name in names]),
        )

    def tens(self, station: str, day_ns: int) -> Summary | None:
        """Ten minutes of a day; None if there is no file."""
        table = self._read("tens", station, day_ns)
        if table is None:
            return None
        return Summary(time_ns=_stamps(table), **{name: _of_lists(table[name]) for name in _SUMMARY})

    def write_samples(self, station: str, day_ns: int, samples: Samples) -> None:
        """Write the samples of a day, and see that they can be read back."""
        columns = {"seq": pa.array(samples.seq), "quality": pa.array(samples.quality.astype(np.int8))}
        values = dict(zip(samples.columns, samples.values.T, strict=True))
        path = self.path("samples", station, day_ns)
        _write(path, samples.time_ns, values, columns, Origin(station=station))
        _check(path, lambda: self.samples(station, day_ns), samples, ("time_ns", "seq", "quality", "values"))
        self._ledger.note(station, "write", path)

    def write_minutes(self, station: str, day_ns: int, minutes: Summary) -> None:
        """Write the minutes of a day, and see that they can be read back."""
        names = columns_of(pumps_of_width(minutes.mean.shape[1]))
        counts = {f"{name}_count": column for name, column in zip(names, minutes.count.T, strict=True)}
        path = self.path("minutes", station, day_ns)
        _write(path, minutes.time_ns, minutes.columns() | counts, {}, Origin(station=station))
        _check(path, lambda: self.minutes(station, day_ns), minutes, ("time_ns", *_SUMMARY))
        self._ledger.note(station, "write", path)

    def write_tens(self, station: str, day_ns: int, tens: Summary) -> None:
        """Write the ten minutes of a day, and see that they can be read back."""
        path = self.path("tens", station, day_ns)
        lists = {name: _as_lists(getattr(tens, name)) for name in _SUMMARY}
        _write(path, tens.time_ns, {}, lists, Origin(station=station))
        _check(path, lambda: self.tens(station, day_ns), tens, ("time_ns", *_SUMMARY))
        self._ledger.note(station, "write", path)

    def damage(self) -> list[str]:
        """Daily files that are missing, cannot be read, or are not what was written."""
        unread: dict[Path, str] = {}
        for station in self.stations():
            for form in get_args(Form):
                for day_ns in self.days_ns(form, station):
                    try:
                        self._read(form, station, day_ns)
                    except StoreError as error:
                        unread[self.path(form, station, day_ns)] = str(error)
        told = list(unread.values())
        for station in self._ledger.stations():
            if self._ledger.damage(station, unread):
                time.sleep(SETTLE_S)  # a file may be written just now
                told += self._ledger.damage(station, unread)
        return told

    def missing(self) -> int:
        """Tell the daily files that are missing, once; how many."""
        count = 0
        for station in self._ledger.stations():
            for path in self._ledger.missing(station):
                log.error("%s: is missing", path)
                self._ledger.note(station, "lose", path)
                count += 1
        return count

    def put_aside_damaged_ledgers(self) -> int:
        """Put the lists of daily files aside that are not what was written, and tell it; how many."""
        count = 0
        for station in self._ledger.stations():
            damage = self._ledger.put_aside_damaged(station)
            if damage:
                log.error("station '%s': its list of daily files is put aside: %s", station, "; ".join(damage))
                count += 1
        return count

    def look_at(self, form: Form, station: str, day_ns: int) -> int:
        """Put the file of a day aside if it cannot be read; tell it once if it is another one; how many damages."""
        if self.put_aside_damaged(form, station, day_ns):
            return 1
        path = self.path(form, station, day_ns)
        is_changed = self._ledger.is_changed(station, path)
        if is_changed:
            log.error("%s: is another one than was written; it can be read, and stays", path)
        if is_changed or path not in self._ledger.expected(station):
            self._ledger.note(station, "find", path)
        return int(is_changed)

    def put_aside_damaged(self, form: Form, station: str, day_ns: int) -> bool:
        """Put the file of a day aside if it is not what was written; whether it was."""
        path = self.path(form, station, day_ns)
        try:
            self._read(form, station, day_ns)
        except StoreError as error:
            aside = path.with_name(f"{path.name}.refused")
            self._ledger.note(station, "put aside", path)
            try:
                path.replace(aside)
            except OSError as reason:
                raise StoreError(f"{path}: cannot be put aside: {reason.strerror or reason}") from error
            log.warning("%s; kept as %s", error, aside.name)
            return True
        return False

    def delete(self, form: Form, station: str, day_ns: int) -> None:
        """Delete the file of a day."""
        path = self.path(form, station, day_ns)
        is_noted = self._is_noted(station, path)
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise StoreError(f"{path}: cannot be deleted: {error.strerror or error}") from error
        if not is_noted:
            self._ledger.note(station, "delete", path)

    def _is_noted(self, station: str, path: Path) -> bool:
        """Whether it could be written down that a file goes; a full disk must not keep it."""
        try:
            self._ledger.note(station, "delete", path)
        except StoreError:
            return False
        return True

    def _read(self, form: Form, station: str, day_ns: int, columns: list[str] | None = None) -> pa.Table | None:
        """Table of a day; None if there is no file.

        Raises
        ------
        DamagedDayError
            If the file cannot be read, holds nothing, or is that of another form, station or day.
        """
        path, place = self.path(form, station, day_ns), (form, station, day_ns)
        try:
            file = pa.parquet.ParquetFile(path, page_checksum_verification=True)
            table, names = file.read(columns), set(file.schema_arrow.names)
            said = Origin.of_metadata(table.schema.metadata or {}).station
        except FileNotFoundError:
            return None
        except (OSError, ValueError, pa.ArrowException) as error:
            raise DamagedDayError(f"{path}: cannot be read: {error}", *place) from error
        if not names.issuperset(_columns(form, names)):
            raise DamagedDayError(f"{path}: holds no {form}", *place)
        if not table.num_rows:
            raise DamagedDayError(f"{path}: holds no row", *place)
        time_ns = _stamps(table)
        if said not in (station, None) or not np.all((time_ns >= day_ns) & (time_ns < day_ns + DAY_NS)):
            raise DamagedDayError(f"{path}: is of station '{said}' or of another day", *place)
        return table


def _columns(form: Form, names: Iterable[str]) -> set[str]:
    """Columns that a file of a form has, by those that tell how many pumps it is of."""
    if form == "tens":
        return {"time", *_SUMMARY}
    values = columns_of(pumps_of(names))
    if form == "samples":
        return {"time", "seq", "quality", *values}
    return {"time", *values, *(f"{name}_{end}" for name in values for end in ("count", "min", "max"))}


def _check(
    path: Path,
    read: Callable[[], Samples | Summary | None],
    given: Samples | Summary,
    names: tuple[str, ...],
) -> None:
    """See that a file just written holds what it should; a disk that cannot hold it now is asked again later."""
    try:
        kept = read()
    except DamagedDayError as error:
        raise StoreError(str(error)) from error
    if kept is None or not all(
        np.array_equal(getattr(kept, name), getattr(given, name), equal_nan=True) for name in names
    ):
        raise StoreError(f"{path}: does not hold what was written")


def _write(path: Path, time_ns: Integers, values: dict[str, Floats], columns: dict[str, Any], origin: Origin) -> None:
    arrays = {name: pa.array(column, mask=np.isnan(column)) for name, column in values.items()}
    table = pa.table({"time": pa.array(time_ns, _STAMP), **columns, **arrays})
    table = table.replace_schema_metadata(origin.metadata)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as file:
            pa.parquet.write_table(
                table,
                file,
                compression="zstd",
                write_page_checksum=True,
                use_dictionary=[name for name in table.column_names if name.endswith(_FEW_VALUES)],
                use_byte_stream_split=[name for name in values if not name.endswith(_FEW_VALUES)],
                column_encoding={
                    name: "DELTA_BINARY_PACKED" for name in ("time", "seq") if name in table.column_names
                },
            )
            file.flush()
            os.fsync(file.fileno())
        _sync_folders(path.parent)
    except RecordingError as error:
        raise StoreError(str(error)) from error
    except (OSError, pa.ArrowException) as error:
        raise StoreError(f"{path}: cannot be written: {error}") from error


def _sync_folders(folder: Path) -> None:
    """Make sure that a new name in a folder, and the folder itself, outlast a power failure."""
    for each in (folder, folder.parent, folder.parent.parent):
        descriptor = os.open(each, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _as_lists(matrix: Floats) -> Any:
    return pa.FixedSizeListArray.from_arrays(pa.array(matrix.ravel()), matrix.shape[1])


def _of_lists(column: Any) -> Floats:
    numbers: Any = np.from_dlpack(column.combine_chunks().flatten())
    matrix: Floats = numbers.reshape(len(column), -1)
    return matrix


def _numbers(column: Any) -> Any:
    """Array of a column, NaN for null; unlike `to_numpy` this does not load pandas, where that is installed."""
    array = column.combine_chunks()
    if not array.null_count:
        return np.from_dlpack(array)
    places = slice(array.offset, array.offset + len(array))
    validity, values = array.buffers()
    is_there = np.unpackbits(np.frombuffer(validity, dtype=np.uint8), bitorder="little")[places]
    return np.where(is_there, np.frombuffer(values, dtype=np.float64)[places], np.nan)


def _stamps(table: pa.Table) -> Integers:
    stamps: Integers = _numbers(table["time"].cast(pa.int64()))
    return stamps


def _matrix(table: pa.Table, names: tuple[str, ...] | list[str]) -> Floats:
    return np.stack([_numbers(table[name]) for name in names], axis=1)
