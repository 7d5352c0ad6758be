"""Header of a table that was written for people: title lines above it, units below it, or none at all."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from wetwell.protocols.recordings.importers.tables.block import without_doubles
from wetwell.protocols.recordings.importers.times.time_format import looks_like_time

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
        A name that the header must hold; without it the header is the first full line above the data.

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
    if needed is not None:
        places = [place for place, row in enumerate(rows) if needed in {cell.strip() for cell in row}]
        if needed.isdecimal() and not places:
            return _header(rows, None, _first_data(rows, 0))
        if not places:
            first = next((row for row in rows if sum(bool(cell.strip()) for cell in row) > 1), [])
            raise ValueError(
                f"columns.time: '{needed}' is in no line at the top; there is {', '.join(map(repr, first[:8]))}"
            )
        return _header(rows, places[0], _first_data(rows, places[0] + 1))
    data = _first_data(rows, 0)
    width = len(rows[data]) if data < len(rows) else 0
    if not width:
        raise ValueError("no line with a date and values was found at the top")
    full = [place for place in range(data) if _filled(rows[place]) >= max(2, width / 2)]
    return _header(rows, full[0] if full else None, data)


def _filled(row: Sequence[str]) -> int:
    return sum(bool(cell.strip()) for cell in row)


def _first_data(rows: Sequence[Sequence[str]], begin: int) -> int:
    """Place of the first row that is data, and so is the next; `len(rows)` if there is none."""
    for place in range(begin, len(rows)):
        if _is_data(rows[place]) and (place + 1 >= len(rows) or _is_data(rows[place + 1])):
            return place
    return len(rows)


def _is_data(row: Sequence[str]) -> bool:
    """Whether a row holds a stamp, or begins with a number and has no other words than a tag and a status."""
    cells = [cell.strip() for cell in row if cell.strip()]
    if len(cells) < 2:
        return False
    numbers = sum(_NUMBER.fullmatch(cell) is not None for cell in cells)
    return any(map(looks_like_time, cells)) or (_NUMBER.fullmatch(cells[0]) is not None and numbers >= len(cells) / 2)


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
