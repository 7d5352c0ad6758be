"""Exports as Excel workbooks."""

import datetime as dt
from collections.abc import Collection, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import python_calamine

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.importers.mapping import TagMapping
from wetwell.protocols.recordings.importers.refusals import Refusals
from wetwell.protocols.recordings.importers.tables.block import Block, ExportFile
from wetwell.protocols.recordings.importers.tables.dialect import find_decimal
from wetwell.protocols.recordings.importers.tables.header import MOST_LOOKED, find_header

_SHEET_ROWS = 20_000


class ExcelFile(ExportFile):
    """A sheet of a workbook."""

    def __init__(self, path: Path, mapping: TagMapping | None) -> None:
        self.path = path
        self.assumed = {}
        try:
            with path.open("rb"):
                book = python_calamine.load_workbook(str(path))
            if not book.sheet_names:
                raise RecordingError(f"{path}: sheet: there is none")
            name = (mapping.sheet if mapping else None) or book.sheet_names[0]
            if name not in book.sheet_names:
                raise RecordingError(f"{path}: sheet: got '{name}', there are {', '.join(book.sheet_names)}")
            self._sheet = book.get_sheet_by_name(name)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
        except (python_calamine.CalamineError, ValueError) as error:
            raise RecordingError(f"{path}: is no workbook that can be read: {error}") from error
        if len(book.sheet_names) > 1 and not (mapping and mapping.sheet):
            self.assumed["sheet"] = f"'{name}', the first of {len(book.sheet_names)}"
        rows = [[_text(cell, ".") for cell in row] for row in islice(self._sheet.iter_rows(), MOST_LOOKED)]
        try:
            header = find_header(rows, mapping.columns.time if mapping else None)
        except ValueError as error:
            raise RecordingError(f"{path}: {error}") from error
        self.names, self.notes, self._first_row = header.names, header.notes, header.first_row
        texts = [
            cell
            for row in islice(self._sheet.iter_rows(), header.first_row - 1, MOST_LOOKED)
            for cell in row
            if isinstance(cell, str)
        ]
        self.decimal = (mapping.decimal if mapping else None) or find_decimal(texts) or "."
        if header.first_row != 2:
            self.assumed["lines"] = f"header {header.row or 'none'}, first row {header.first_row}"

    def needed_bytes(self, signals: int) -> int:  # noqa: ARG002 - the library holds the whole sheet
        """Memory that the sheet takes: a cell of the library and one of ours. [B]."""
        return 100 * int(self._sheet.total_height) * int(self._sheet.total_width)

    def blocks(self, wanted: Collection[str], refusals: Refusals) -> Iterator[Block]:  # noqa: ARG002 - all rows are whole
        """Yield the rows with the wanted columns: times, numbers or texts."""
        places = {name: place for place, name in enumerate(self.names) if name in wanted}
        rows = islice(self._sheet.iter_rows(), self._first_row - 1, None)
        line = self._first_row + (self._sheet.start or (0, 0))[0]
        while chunk := list(islice(rows, _SHEET_ROWS)):
            columns = {name: self._column([row[place] for row in chunk]) for name, place in places.items()}
            yield Block(columns=columns, lines=np.arange(line, line + len(chunk)))
            line += len(chunk)

    def _column(self, cells: Sequence[Any]) -> pa.Array:
        kinds = {type(cell) for cell in cells if cell != ""}
        known = [None if cell == "" else cell for cell in cells]
        if kinds and kinds <= {dt.datetime, dt.date}:
            return pa.array([_moment(cell) for cell in known], pa.timestamp("ms"))
        if kinds and kinds <= {int, float, bool}:
            return pa.array([None if cell is None else float(cell) for cell in known], pa.float64())
        return pa.array(["" if cell is None else _text(cell, self.decimal) for cell in known], pa.string())


def _moment(cell: dt.date | None) -> dt.datetime | None:
    """A cell with a date as a time; Excel keeps midnight as a date alone."""
    if cell is None or isinstance(cell, dt.datetime):
        return cell
    return dt.datetime(cell.year, cell.month, cell.day)  # noqa: DTZ001 - the zone is the mapping's


def _text(cell: Any, decimal: str) -> str:
    if isinstance(cell, dt.datetime | dt.date):
        return str(cell)
    if isinstance(cell, float):
        return (str(int(cell)) if cell.is_integer() and abs(cell) < 1e15 else repr(cell)).replace(".", decimal)
    return str(cell)
