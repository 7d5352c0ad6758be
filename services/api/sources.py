"""What a recording and a station may be given as."""

import os
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import pyarrow as pa

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.reading import Reading
from wetwell.protocols.recordings.recording import Recording, recording_of
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_station


@runtime_checkable
class ArrowTable(Protocol):
    """A table by the Arrow C data interface: of pandas, polars, DuckDB, PyArrow, or a frame of ours."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> Any: ...


RecordingSource = str | os.PathLike[str] | ArrowTable
"""A file (CSV, CSV.gz, Parquet), or a table with the columns of a recording."""
StationSource = str | os.PathLike[str] | Station
"""A station file, the name of a station that comes with the package, or a station."""


def station_of(source: StationSource) -> Station:
    """Station that is given.

    Raises
    ------
    ConfigError
        If there is none, or it breaks a rule.
    """
    return source if isinstance(source, Station) else find_station(os.fspath(source))


def rows_of(source: RecordingSource, station: Station | None, reading: Reading) -> Recording:
    """Recording that is given, in the order of its rows; with a station one of that station.

    Raises
    ------
    RecordingError
        If it cannot be read, or is not of the station.
    TypeError
        If it is neither a path nor a table.
    """
    if isinstance(source, str | os.PathLike):
        place = os.fspath(source)
        recording = reading.read(Path(source))
    elif isinstance(source, ArrowTable):
        place = f"table of {type(source).__module__.partition('.')[0]}"
        try:
            table = pa.table(source)
        except (pa.ArrowException, TypeError, ValueError) as error:
            raise RecordingError(f"{place}: is no Arrow table: {error}") from error
        recording = recording_of(table, place, reading.time_zone)
    else:
        raise TypeError(
            f"recording: got {type(source).__name__}, must be a path, or a table of pandas, polars or Arrow"
        )
    return recording if station is None else reading.taken_for(recording, station, place)
