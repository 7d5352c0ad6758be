"""Recordings: one station's samples as columns, in CSV, CSV.gz or Parquet, the same columns everywhere.

Columns: `time` (ISO 8601 with a Z or an offset), `level_m`, optional `inflow_m3h`, and for each pump i from 1
`pump{i}_frequency_hz`, `pump{i}_flow_m3h`, `pump{i}_head_m`, optional `pump{i}_power_kw` and `pump{i}_running`.
What a crew did is in `by_hand` (1 while it commands the pumps), `valve_open` and `inlet_open` (0 while shut).
Columns that start with `covariate_` are those of a user: rain, tide, temperature.
Empty or NaN is "no value". Columns that start with `truth_` hold what only a simulator can know.
"""

import contextlib
import gzip
import io
import re
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count, repeat
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.local_time import to_utc
from wetwell.protocols.messages.readings import PumpRow, Row
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.quantities import (
    HAND_COLUMNS,
    PUMP_ANALOGUES,
    PUMP_QUANTITIES,
    STATION_QUANTITIES,
    pump_column,
    pump_of,
    pumps_of,
)
from wetwell.protocols.recordings.covariates import covariate_of
from wetwell.protocols.recordings.layout import STAMP, arrow_of, parquet_table, parquet_writer, texts_of
from wetwell.protocols.recordings.origin import MARK, Origin, StoredValue
from wetwell.protocols.recordings.stamp_texts import iso_texts
from wetwell.protocols.timestamps import from_iso, has_zone

TRUTH_PREFIX = "truth_"
SUFFIXES = (".csv", ".csv.gz", ".parquet")


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Samples of one station, in the order of their rows.

    Attributes
    ----------
    time_ns : (n,) int64
        Nanoseconds since 1970, UTC; may repeat, jump or go back.
    columns : mapping of column name to (n,) float64
        Measured values; NaN is "no value". A column that is absent was never measured.
    truth : mapping of column name to (n,) array
        Columns that start with `truth_`: numbers or texts. No diagnosis may read them.
    ignored : tuple of str
        Columns of the file that are none of these.
    station : str, optional
        Name of the station, where it is known.
    value : "instant", "mean" or "held"
        What a stored value stands for.
    """

    time_ns: Integers
    columns: Mapping[str, Floats]
    truth: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    station: str | None = None
    value: StoredValue = "instant"

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def pumps(self) -> int:
        """Number of pumps that the columns speak of."""
        return pumps_of(self.columns)

    @property
    def covariates(self) -> dict[str, Floats]:
        """(n,) values of the columns of a user, by their names without the prefix."""
        named = ((covariate_of(column), values) for column, values in self.columns.items())
        return {name: values for name, values in named if name is not None}

    def column(self, name: str) -> Floats:
        """(n,) values of a column, NaN throughout where it is absent."""
        if name in self.columns:
            return self.columns[name]
        return np.full(len(self), np.nan)

    def of_pumps(self, name: str, pumps: int | None = None) -> Floats:
        """(pumps, n) values of a quantity of each pump, of so many or of all; NaN where its column is absent."""
        pumps = self.pumps if pumps is None else pumps
        columns = [self.column(pump_column(i, name)) for i in range(1, pumps + 1)]
        return np.array(columns).reshape(pumps, len(self))

    def samples(self, station: str, first_seq: int = 0) -> Iterator[Sample]:
        """Yield the rows as messages, `seq` counting from `first_seq`."""
        for row in self.rows():
            yield Sample(
                station=station,
                seq=first_seq + row.seq,
                time=row.time,
                level_m=_value(row.level_m),
                inflow_m3h=_value(row.inflow_m3h),
                pumps=tuple(map(_reading, row.pumps)),
            )

    def rows(self) -> Iterator[Row]:
        """Yield the rows as they are, without the checks of a message."""
        pumps = [
            zip(
                *(self.column(pump_column(i, name)).tolist() for name in PUMP_ANALOGUES),
                map(_flag, self.column(pump_column(i, "running")).tolist()),
                strict=True,
            )
            for i in range(1, self.pumps + 1)
        ]
        station = (self.column(name).tolist() for name in STATION_QUANTITIES)
        of_pumps = zip(*(map(PumpRow._make, pump) for pump in pumps), strict=True) if pumps else repeat(())
        return map(Row, count(), self.time_ns.tolist(), *station, of_pumps)


def _flag(number: float) -> bool | None:
    return number > 0 if number == number else None  # noqa: PLR0124 - the quickest test for NaN


def _value(number: float | None) -> float | None:
    return number if number == number else None  # noqa: PLR0124 - the quickest test for NaN


def _reading(pump: PumpRow) -> PumpReading:
    return PumpReading(**dict(zip(PUMP_QUANTITIES, map(_value, pump), strict=True)))


def read_recording(path: Path, time_zone: ZoneInfo | None = None) -> Recording:
    """Read a recording.

    Parameters
    ----------
    path : Path
    time_zone : ZoneInfo, optional
        Of the clock whose stamps have no zone; those that have one keep it.

    Raises
    ------
    RecordingError
        If the file cannot be read, its ending is not one of `SUFFIXES`, it has no rows, a needed column is missing, a
        value is not of its column's kind, or a stamp has no zone; one line with file, column and rule.
    """
    table, origin = _read_table(path)
    recording = recording_of(table, path, time_zone, origin)
    del table
    pa.default_memory_pool().release_unused()  # Arrow keeps more than the recording is large
    return recording


def recording_of(
    table: pa.Table, place: Path | str, time_zone: ZoneInfo | None = None, origin: Origin | None = None
) -> Recording:
    """Recording in a table with the columns of one.

    Parameters
    ----------
    table : pyarrow.Table
    place : Path or str
        What the table is called in an error.
    time_zone : ZoneInfo, optional
        Of the clock whose stamps have no zone; those that have one keep it.
    origin : Origin, optional
        Station and what a value stands for; by default what the metadata of the table say.

    Raises
    ------
    RecordingError
        As `read_recording`, but of the file.
    """
    origin = Origin.of_metadata(table.schema.metadata or {}) if origin is None else origin
    if "time" not in table.column_names:
        raise RecordingError(f"{place}: column 'time' is missing: `wetwell convert` makes a recording of an export")
    columns: dict[str, Floats] = {}
    truth: dict[str, npt.NDArray[Any]] = {}
    ignored: list[str] = []
    for name in table.column_names:
        if name == "time":
            continue
        if _is_measured(name):
            columns[name] = _numbers(table[name], name, place)
        elif name.startswith(TRUTH_PREFIX):
            truth[name] = table[name].to_numpy()
        else:
            ignored.append(name)
    recording = Recording(
        time_ns=_stamps(table["time"], time_zone, place),
        columns=columns,
        truth=truth,
        ignored=tuple(ignored),
        station=origin.station,
        value=origin.value,
    )
    if recording.pumps == 0:
        raise RecordingError(f"{place}: no pump column such as 'pump1_flow_m3h' found")
    if len(recording) == 0:
        raise RecordingError(f"{place}: has no rows")
    return recording


def _is_measured(column: str) -> bool:
    is_ours = column in STATION_QUANTITIES or column in HAND_COLUMNS or pump_of(column) > 0
    return is_ours or covariate_of(column) is not None


def _suffix(path: Path) -> str:
    for suffix in SUFFIXES:
        if path.name.endswith(suffix):
            return suffix
    raise RecordingError(f"{path}: a recording ends in one of {', '.join(SUFFIXES)}")


def _read_table(path: Path) -> tuple[pa.Table, Origin]:
    suffix = _suffix(path)
    header: list[str] = []
    mark = ""
    try:
        if suffix == ".parquet":
            _check_once(pa.parquet.read_schema(path).names, path)
            with pa.parquet.ParquetFile(path) as file:  # `read_table` would load pandas, half a second
                table = file.read()
            _ = [getattr(field.type, "tz", None) for field in table.schema]  # raises, as the names, if no UTF-8
            return table, Origin.of_metadata(table.schema.metadata or {})
        mark, header = _csv_header(path)
        types = {name: pa.float64() for name in header if _is_measured(name)}
        table = pa.csv.read_csv(
            path,
            read_options=pa.csv.ReadOptions(use_threads=False, skip_rows=int(bool(mark))),
            convert_options=pa.csv.ConvertOptions(
                column_types=types | {"time": pa.string()}, strings_can_be_null=False
            ),
        )
        return table, Origin.of_mark(mark)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (pa.ArrowException, UnicodeDecodeError, EOFError, zlib.error, ValueError) as error:
        fault = _csv_fault(str(error), header, 2 if mark else 1)
        if isinstance(error, UnicodeDecodeError) and suffix != ".parquet":
            fault = "is not UTF-8, so not a recording: `wetwell convert` makes one of it"
        elif any(header) and "time" not in header:
            fault = "has no column 'time', so is no recording: `wetwell convert` makes one of an export"
        raise RecordingError(f"{path}: {fault}") from error


def _csv_fault(message: str, header: list[str], header_rows: int) -> str:
    """First line of an Arrow message, with the column's name for its number and rows counted from 1 as elsewhere."""
    line = next(iter(message.splitlines()), "not a recording")
    line = re.sub(r"In CSV column #(\d+): ", lambda match: f"column '{header[int(match[1])]}', ", line)
    return re.sub(r"Row #(\d+)", lambda match: f"row {int(match[1]) - header_rows}", line)


def _csv_header(path: Path) -> tuple[str, list[str]]:
    """Line that says where the recording comes from, empty if there is none, and the names of the columns."""
    opener = gzip.open if path.name.endswith(".gz") else open
    with opener(path, "rt", encoding="utf-8-sig") as file:
        mark, line = "", str(file.readline())
        if line.startswith(MARK):
            mark, line = line, str(file.readline())
    header = [name.strip('"') for name in line.rstrip("\r\n").split(",")]
    _check_once(header, path)
    return mark, header


def _check_once(names: list[str], path: Path) -> None:
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise RecordingError(f"{path}: column '{repeated[0]}' stands twice")


def _numbers(column: pa.ChunkedArray, name: str, path: Path | str) -> Floats:
    try:
        values: Floats = column.cast(pa.float64()).to_numpy()
    except pa.ArrowException as error:
        raise RecordingError(f"{path}: column '{name}' must hold numbers: {error}") from error
    return values


def _stamps(column: pa.ChunkedArray, time_zone: ZoneInfo | None, path: Path | str) -> Integers:
    if pa.types.is_timestamp(column.type):
        if column.null_count:
            row = int(np.argmax(column.is_null().to_numpy())) + 1
            raise RecordingError(f"{path}: column 'time', row {row}: is empty")
        try:
            stamps: Integers = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64()).to_numpy()
        except pa.ArrowInvalid as error:
            raise RecordingError(f"{path}: column 'time': {error}") from error
        is_local = np.full(stamps.size, column.type.tz is None)
    else:
        texts = column.cast(pa.string()).to_numpy()
        try:
            stamps = np.array([from_iso(text) for text in texts], dtype=np.int64)
        except (TypeError, ValueError):
            row = next(row for row, text in enumerate(texts, start=1) if not _is_stamp(text))
            rule = "must be ISO 8601 such as 2025-01-31T06:00:00Z"
            raise RecordingError(f"{path}: column 'time', row {row}: got {texts[row - 1]!r}, {rule}") from None
        is_local = np.array([not has_zone(text) for text in texts], dtype=bool)
    return _utc(stamps, is_local, column, time_zone, path) if is_local.any() else stamps


def _utc(
    stamps_ns: Integers, is_local: Flags, column: pa.ChunkedArray, time_zone: ZoneInfo | None, path: Path | str
) -> Integers:
    """Stamps of which some are those of a local clock, in UTC."""
    local = np.flatnonzero(is_local)
    if time_zone is None:
        row, ways = int(local[0]), "give --time-zone such as Europe/Helsinki, or use wetwell convert"
        raise RecordingError(f"{path}: column 'time', row {row + 1}: got '{column[row]}' without a zone: {ways}")
    times = to_utc(stamps_ns[local], time_zone)
    if times.is_missing.any():
        row, rule = int(local[np.argmax(times.is_missing)]), f"in an hour that clocks of {time_zone.key} leave out"
        raise RecordingError(f"{path}: column 'time', row {row + 1}: got '{column[row]}', {rule}")
    if times.undecided:
        rule = f"lie in an hour that comes twice in {time_zone.key}, and the rows do not say which it is"
        way = "wetwell convert takes the first"
        raise RecordingError(f"{path}: column 'time': {times.undecided} stamps {rule}: {way}")
    stamps_ns = stamps_ns.copy()
    stamps_ns[local] = times.time_ns
    return stamps_ns


def _is_stamp(text: Any) -> bool:
    try:
        from_iso(text)
    except (TypeError, ValueError):
        return False
    return True


def write_recording(recording: Recording, path: Path) -> None:
    """Write a recording; the file appears whole or not at all, the same bytes for the same recording.

    Raises
    ------
    RecordingError
        If the file cannot be written or its ending is not one of `SUFFIXES`.
    """
    with recording_writer(path) as write:
        write(recording)


@contextlib.contextmanager
def recording_writer(path: Path) -> Iterator[Callable[[Recording], None]]:
    """Write a recording block by block; the file appears whole at the end of the `with`, or not at all.

    All blocks have the columns of the first. A block of Parquet is at least one row group.

    Raises
    ------
    RecordingError
        If the file cannot be written or its ending is not one of `SUFFIXES`.
    """
    suffix = _suffix(path)
    try:
        with atomic_file(path) as file, contextlib.ExitStack() as stack:
            yield _block_writer(file, suffix, stack)
    except pa.ArrowException as error:
        raise RecordingError(f"{path}: cannot be written: {error}") from error


def table_of(recording: Recording) -> pa.Table:
    """Arrow table of a recording; `time` in ns, UTC; station and value in the metadata."""
    columns = {name: arrow_of(values) for name, values in _columns(recording).items()}
    table = pa.table({"time": arrow_of(recording.time_ns, STAMP), **columns})
    return table.replace_schema_metadata(_origin(recording).metadata)


def _columns(recording: Recording) -> dict[str, npt.NDArray[Any]]:
    return {**recording.columns, **recording.truth}


def _origin(recording: Recording) -> Origin:
    return Origin(station=recording.station, value=recording.value)


def _block_writer(file: io.BufferedIOBase, suffix: str, stack: contextlib.ExitStack) -> Callable[[Recording], None]:
    if suffix == ".csv.gz":
        file = stack.enter_context(gzip.GzipFile(filename="", fileobj=file, mode="wb", compresslevel=6, mtime=0))
    parquet: Any = None
    is_begun = False

    def write(block: Recording) -> None:
        nonlocal parquet, is_begun
        if suffix == ".parquet":
            table = parquet_table(block.time_ns, _columns(block), _origin(block).metadata)
            if not is_begun:
                parquet = stack.enter_context(parquet_writer(file, table.schema))
            parquet.write_table(table)
        else:
            texts = {name: texts_of(values) for name, values in _columns(block).items()}
            table = pa.table({"time": iso_texts(block.time_ns), **texts})
            if not is_begun:
                file.write(_origin(block).mark.encode())
                file.write(",".join(table.column_names).encode() + b"\n")
            pa.csv.write_csv(table, file, pa.csv.WriteOptions(include_header=False, quoting_style="none"))
        is_begun = True

    return write
