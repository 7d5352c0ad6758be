"""What all results share: a table by Arrow, and a face in a notebook."""

from abc import ABC, abstractmethod
from html import escape
from pathlib import Path
from typing import Any

import pyarrow as pa

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.station.station_file import Station
from wetwell.services.batch.field_data import write_station


class Picture:
    """A chart as SVG; a notebook shows it, and `save` writes it.

    Parameters
    ----------
    svg : str
    """

    def __init__(self, svg: str) -> None:
        self.svg = svg

    def _repr_html_(self) -> str:
        return f'<div style="background:#fff;max-width:780px">{self.svg}</div>'

    def __repr__(self) -> str:
        return f"Picture of {len(self.svg)} characters of SVG; save(path) writes it"

    def save(self, path: str | Path) -> None:
        """Write the chart; the file appears whole or not at all."""
        with atomic_file(Path(path)) as file:
            file.write(self.svg.encode())


class Result(ABC):
    """A result of the API: a value with a table and a picture."""

    @abstractmethod
    def to_arrow(self) -> pa.Table:
        """Arrow table of the result."""

    @abstractmethod
    def plot(self) -> Picture:
        """Picture of the result."""

    @abstractmethod
    def _repr_html_(self) -> str:
        """What a notebook shows."""

    def to_pandas(self) -> Any:
        """Pandas data frame of the result.

        Raises
        ------
        ImportError
            If pandas is not installed; it is no dependency.
        """
        return self.to_arrow().to_pandas()

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> Any:
        """Let pandas, polars and others take the table: `polars.DataFrame(result)`."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)


class StationResult(Result):
    """A result that has changed a station.

    Attributes
    ----------
    station : Station
        As it is now.
    """

    station: Station

    def write(self, path: str | Path) -> None:
        """Write the station file.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """
        write_station(self.station, Path(path))


def html_table(table: pa.Table, rows: int = 10) -> str:
    """First rows of a table as HTML, and how many there are.

    Examples
    --------
    >>> html_table(pa.table({"pump": [1, 2]})).count("<tr>")
    3
    """
    head = "".join(f"<th>{escape(name)}</th>" for name in table.column_names)
    shown = table.slice(0, rows).to_pylist()
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(_text(value))}</td>' for value in row.values())}</tr>" for row in shown
    )
    more = f"<p>{table.num_rows} rows, the first {len(shown)} are shown</p>" if table.num_rows > len(shown) else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def _text(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
