"""A recording in Python: read from a file or a table, or simulated."""

from html import escape
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa

from wetwell.protocols.arrays import Integers
from wetwell.protocols.recordings.reading import Reading
from wetwell.protocols.recordings.recording import Recording, table_of, write_recording
from wetwell.protocols.timestamps import to_iso
from wetwell.services.api.result import Picture, Result, html_table
from wetwell.services.api.sources import RecordingSource, StationSource, rows_of, station_of
from wetwell.services.reports.charts import Series, line_chart


class Frame(Result):
    """Samples of one station, row by row: time, level, inflow, and frequency, flow, head and power of each pump.

    Parameters
    ----------
    recording : Recording
        As the cores take it: `recording.columns` maps names to arrays.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording

    @classmethod
    def of(cls, source: RecordingSource, station: StationSource | None, reading: Reading) -> Self:
        """Frame of a file or a table."""
        return cls(rows_of(source, None if station is None else station_of(station), reading))

    def __len__(self) -> int:
        return len(self.recording)

    def __getitem__(self, name: str) -> Any:
        """(n,) values of a column; NaN is "no value".

        Raises
        ------
        KeyError
            If there is no such column.
        """
        columns = {**self.recording.columns, **self.recording.truth}
        return columns[name]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns beside `time`."""
        return (*self.recording.columns, *self.recording.truth)

    @property
    def time_ns(self) -> Integers:
        """(n,) stamps in ns since 1970, UTC."""
        return self.recording.time_ns

    @property
    def station(self) -> str | None:
        """Name of the station, where it is known."""
        return self.recording.station

    def to_arrow(self) -> pa.Table:
        """Arrow table; `time` in ns, UTC."""
        return table_of(self.recording)

    def write(self, path: str | Path) -> None:
        """Write a recording: CSV, CSV.gz or Parquet, by the ending of the path.

        Raises
        ------
        RecordingError
            If it cannot be written, or the ending is another.
        """
        write_recording(self.recording, Path(path))

    def plot(self, *names: str) -> Picture:
        """Lines of columns over time; without names the level.

        Parameters
        ----------
        *names : str
            Columns with the same unit, at most six.

        Raises
        ------
        KeyError
            If there is no such column.
        """
        shown = names or (("level_m",) if "level_m" in self.columns else self.columns[:1])
        series = [Series(name, self.time_ns, np.asarray(self[name], dtype=float)) for name in shown]
        return Picture(line_chart(f"Station {self.station or '?'}", series, y_label=", ".join(shown), is_time=True))

    def __repr__(self) -> str:
        span = f"{to_iso(int(self.time_ns[0]))} to {to_iso(int(self.time_ns[-1]))}"
        return f"Frame of station {self.station or '?'}: {len(self)} rows, {span}, {self.recording.pumps} pumps"

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>{html_table(self.to_arrow(), rows=5)}"


def read(
    source: RecordingSource,
    station: StationSource | None = None,
    *,
    time_zone: str | None = None,
    as_station: bool = False,
) -> Frame:
    """Read a recording.

    Parameters
    ----------
    source : path or table
        CSV, CSV.gz or Parquet; or a table of pandas, polars or Arrow with the same columns.
    station : Station, path or name, optional
        Station that the recording has to be of.
    time_zone : str, optional
        Of stamps that have none, such as Europe/Helsinki.
    as_station : bool
        Take the recording for one of `station`, whatever name it carries.

    Raises
    ------
    RecordingError
        If it cannot be read or is not of the station; one line with place, column and rule.

    Examples
    --------
    >>> import pyarrow as pa
    >>> table = pa.table({"time": ["2025-01-01T00:00:00Z"], "level_m": [1.2], "pump1_flow_m3h": [98.0]})
    >>> read(table)
    Frame of station ?: 1 rows, 2025-01-01T00:00:00Z to 2025-01-01T00:00:00Z, 1 pumps
    """
    return Frame.of(source, station, Reading.said(time_zone, as_station=as_station))
