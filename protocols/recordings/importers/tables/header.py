"""Header of a table that was written for people: title lines above it, units below it, or none at all."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from wetwell.protocols.recordings.importers.tables.block import without_doubles
from wetwell.protocols.recordings.importers.times.time_format import looks_like_time

MOST_LOOKED = 400
"""Rows of the beginning that tell how a file is written."""

_FULL = 0.8
"""Share of the cells of the fullest line above the data that a header has: that of the times may have no name. [1]"""
_NUMBER = re.compile(r"[+-]?\d[\d.,]*([eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """Where a table begins.

    Attributes
    ----------
    names : tuple of str
        One for each column.
    notes : tuple of tuple of str
        Lines between header and data.
    row : int
        Of the header, from 1; 0 if there is none, and the columns are called "1", "2" and so on.
    first_row : int
        Of the data, from 1.
    """

    names: tuple[str, ...]
    notes: tuple[tuple[str, ...], ...]
    row: int
    first_row: int


def find_header(rows: Sequence[Sequence[str]], needed: str | None = None) -> Header:
    """Header of a table.

    Parameters
    ----------
    rows : sequence of rows
        The first ones, as texts.
    needed : str, optional
        A name that the header must hold; without it the header is the first line above the data that is about as
        full as the fullest of them: a title may hold a delimiter, too.

    Raises
    ------
    ValueError
        If the needed name is in no line, or no line is data.

    Examples
    --------
    >>> header = find_header([["Report"], ["time", "LT1"], ["", "m"], ["2025-01-01 00:00", "1.2"]])
    >>> header.names, header.notes, header.first_row
    (('time', 'LT1'), (('', 'm'),), 4)
    """
    if needed is None:
        data = _first_data(rows, 0, None)
        if data >= len(rows):
            raise ValueError("no line with a date and values was found at the top")
        filled = [_filled(row) for row in rows[:data]]
        least = max(2, len(rows[data]) / 2, _FULL * max(filled, default=0))
        return _header(rows, next((place for place in range(data) if filled[place] >= least), None), data)
    found = [(place, row.index(needed)) for place, row in enumerate(map(_trimmed, rows)) if needed in row]
    if found:
        place, column = found[0]
        return _header(rows, place, _first_data(rows, place + 1, column))
    if needed.isdecimal():
        return _header(rows, None, _first_data(rows, 0, int(needed) - 1))
    first = next((row for row in rows if _filled(row) > 1), [])
    there = ", ".join(map(repr, first[:8]))
    raise ValueError(f"columns.time: '{needed}' is in no line at the top; there is {there}")


def _trimmed(row: Sequence[str]) -> list[str]:
    return [cell.strip() for cell in row]


def _filled(row: Sequence[str]) -> int:
    return sum(bool(cell.strip()) for cell in row)


def _first_data(rows: Sequence[Sequence[str]], begin: int, column: int | None) -> int:
    """Place of the first row that is data; without a known column the next must be so too; `len(rows)` if none is."""
    for place in range(begin, len(rows)):
        following = rows[place + 1 : place + 2] if column is None else []
        if all(_is_data(row, column) for row in [rows[place], *following]):
            return place
    return len(rows)


def _is_data(row: Sequence[str], column: int | None) -> bool:
    """Whether a row has a stamp, in its column if that is known, or begins with a number and has more of them."""
    cells = _trimmed(row)
    if column is not None:
        return column < len(cells) and (cells[column][:1].isdigit() or looks_like_time(cells[column]))
    known = [cell for cell in cells if cell]
    numbers = sum(_NUMBER.fullmatch(cell) is not None for cell in known)
    is_table = numbers > 1 and numbers >= len(known) / 2 and _NUMBER.fullmatch(known[0]) is not None
    return len(cells) > 1 and (is_table or any(map(looks_like_time, known)))


def _header(rows: Sequence[Sequence[str]], place: int | None, data: int) -> Header:
    widths = Counter(len(row) for row in rows[data:] if _filled(row))
    width = widths.most_common(1)[0][0] if widths else len(rows[place or 0])
    if place is None:
        names: tuple[str, ...] = tuple(str(number) for number in range(1, width + 1))
        return Header(names=names, notes=(), row=0, first_row=data + 1)
    names = without_doubles(_fitted(rows[place], width))
    if data >= len(rows):
        data = place + 1
    notes = tuple(_fitted(row, width) for row in rows[place + 1 : data] if _filled(row))
    return Header(names=names, notes=notes, row=place + 1, first_row=data + 1)


def _fitted(row: Sequence[str], width: int) -> tuple[str, ...]:
    return tuple(cell.strip() for cell in [*row, *[""] * width][:width])
