"""Exports as text: CSV and its relatives, in any encoding and with any delimiter, read block by block."""

import codecs
import contextlib
import csv
import gzip
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from wetwell.protocols.arrays import Integers
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.importers.mapping import TagMapping
from wetwell.protocols.recordings.importers.refusals import Refusals
from wetwell.protocols.recordings.importers.tables.block import Block, ExportFile
from wetwell.protocols.recordings.importers.tables.dialect import (
    find_decimal,
    find_delimiter,
    find_encoding,
    lines_of,
)
from wetwell.protocols.recordings.importers.tables.header import MOST_LOOKED, find_header

_BLOCK_BYTES = 1 << 22
_LOOK_BYTES = 1 << 18
_MOST_RAGGED = 0.01
_MOST_RAGGED_ROWS = 10
"""A file in which more rows, and a larger part of them, have another number of fields changes its columns."""
_MARK = "\ufeff"
_UNPACKED = 12
"""How many times as long a file is that comes out of a .gz, roughly."""


class TextFile(ExportFile):
    """A text file whose lines are rows."""

    def __init__(self, path: Path, mapping: TagMapping | None) -> None:
        self.path = path
        head, self._tail = self._ends()
        said = mapping.encoding if mapping else None
        self._encoding = said if said and said.lower() != "utf-16" else find_encoding([head, self._tail])
        try:
            text = codecs.getincrementaldecoder(self._encoding)().decode(head).removeprefix(_MARK)
        except UnicodeDecodeError as error:
            raise RecordingError(f"{path}: is not {self._encoding}: {error.reason} at byte {error.start}") from error
        lines = lines_of(text)[:MOST_LOOKED]
        self._delimiter = (mapping.delimiter if mapping else None) or find_delimiter(lines)
        if self._delimiter is None:
            raise RecordingError(f"{path}: no delimiter was found, neither tab nor ; nor | nor ,; is this a table?")
        rows = [next(csv.reader([line], delimiter=self._delimiter), []) for line in lines]
        try:
            header = find_header(rows, mapping.columns.time if mapping else None)
        except ValueError as error:
            raise RecordingError(f"{path}: {error}") from error
        self.names, self.notes, self._first_line = header.names, header.notes, header.first_row
        found = find_decimal(cell for row in rows[header.first_row - 1 :] for cell in row)
        self.decimal = (mapping.decimal if mapping else None) or found or "."
        looked = {"encoding": self._encoding, "delimiter": repr(self._delimiter), "decimal": repr(self.decimal)}
        self.assumed = {name: text for name, text in looked.items() if not (mapping and getattr(mapping, name))}
        if header.first_row != 2:
            self.assumed["lines"] = f"header {header.row or 'none'}, first row {header.first_row}"

    def _open(self) -> Any:
        return gzip.open(self.path, "rb") if self.path.name.endswith(".gz") else self.path.open("rb")

    def _ends(self) -> tuple[bytes, bytes]:
        """Beginning and end of the file; they do not overlap."""
        with _errors_of(self.path), self._open() as file:
            head = file.read(_LOOK_BYTES)
            if self.path.name.endswith(".gz"):
                return head, b""
            file.seek(max(self.path.stat().st_size - _LOOK_BYTES, len(head)) // 2 * 2)
            return head, file.read()

    def needed_bytes(self, signals: int) -> int:  # noqa: ARG002 - a value takes about as much as its text
        """Memory of stamps and values, about that of their texts, and once more while they are put in order. [B]."""
        return 2 * self.path.stat().st_size * (_UNPACKED if self.path.name.endswith(".gz") else 1)

    def ends(self, wanted: Collection[str]) -> list[Block]:
        """Rows of the first block, and of the end of the file."""
        text = self._tail.decode(self._encoding, errors="replace").partition("\n")[2]
        table = self._parsed(text.encode(), 0, wanted, [])
        return [*super().ends(wanted), _block(table, np.zeros(len(table), dtype=np.int64))]

    def blocks(self, wanted: Collection[str], refusals: Refusals) -> Iterator[Block]:
        """Yield the rows with the wanted columns as texts; rows with another number of fields go to `refusals`.

        Raises
        ------
        RecordingError
            If the file cannot be read, is not of its encoding, or changes its columns.
        """
        line, rows, width = 1, 0, len(self.names)
        ragged: list[tuple[int, str]] = []
        for piece in self._pieces():
            skipped = min(max(self._first_line - line, 0), piece.count(b"\n"))
            bad: list[tuple[int, str]] = []
            table = self._parsed(piece, skipped, wanted, bad)
            numbers = np.delete(np.arange(len(table) + len(bad)), [place for place, _ in bad])
            ragged += [(line + skipped + place, text) for place, text in bad]
            rows += len(table)
            yield _block(table, line + skipped + numbers)
            line += piece.count(b"\n")
        if len(ragged) > max(_MOST_RAGGED * rows, _MOST_RAGGED_ROWS):
            raise RecordingError(
                f"{self.path}: line {ragged[0][0]} and {len(ragged) - 1} more have not the {width} columns of the "
                "header; if the columns change half way, convert the parts as files of their own"
            )
        if ragged:
            lines = np.array([number for number, _ in ragged])
            refusals.add("another number of columns", self.path, lines, ragged[0][1])

    def _pieces(self) -> Iterator[bytes]:
        """Whole lines in UTF-8, some megabytes at once."""
        decode = codecs.getincrementaldecoder(self._encoding)().decode
        rest = b""
        is_begin = True
        with _errors_of(self.path), self._open() as file:
            while raw := file.read(_BLOCK_BYTES):
                text = rest + (raw if self._encoding == "utf-8" else decode(raw).encode())
                if is_begin:
                    text, is_begin = text.removeprefix(codecs.BOM_UTF8), False
                end = text.rfind(b"\n") + 1
                if end:
                    yield text[:end]
                rest = text[end:]
        if rest:
            yield rest

    def _parsed(self, piece: bytes, skipped: int, wanted: Collection[str], bad: list[tuple[int, str]]) -> pa.Table:
        """Table of whole lines after some skipped ones; places and texts of rows of another length go to `bad`."""

        def put_aside(row: Any) -> str:
            bad.append((row.number - 1 - skipped, row.text))
            return "skip"

        types = {name: pa.string() for name in self.names if name in wanted}
        try:
            return pa.csv.read_csv(
                pa.BufferReader(piece),
                pa.csv.ReadOptions(
                    column_names=list(self.names), skip_rows=skipped, use_threads=False, block_size=len(piece) + 1
                ),
                pa.csv.ParseOptions(
                    delimiter=self._delimiter, invalid_row_handler=put_aside, ignore_empty_lines=False
                ),
                pa.csv.ConvertOptions(include_columns=list(types), column_types=types, strings_can_be_null=False),
            )
        except pa.ArrowInvalid as error:
            if "Empty CSV" in str(error):
                return pa.table({name: pa.array([], pa.string()) for name in types})
            raise RecordingError(f"{self.path}: {str(error).splitlines()[0]}") from error


def _block(table: pa.Table, lines: Integers) -> Block:
    return Block(columns={name: _whole(table[name]) for name in table.column_names}, lines=lines)


def _whole(column: pa.ChunkedArray) -> pa.Array:
    return (
        column.chunk(0)
        if column.num_chunks == 1
        else pa.concat_arrays(column.chunks)
        if column.num_chunks
        else pa.array([], pa.string())
    )


@contextlib.contextmanager
def _errors_of(path: Path) -> Iterator[None]:
    try:
        yield
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path}: is not {error.encoding}: {error.reason}; give its 'encoding'") from error
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
