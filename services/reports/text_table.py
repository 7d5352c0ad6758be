"""Tables as text that fits a terminal."""

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from textwrap import wrap

SCREEN_WIDTH = 100
"""Of all that commands print as tables: two of them stand beside each other on a wide screen. [characters]"""
NARROWEST = 10
"""A column of words is not made narrower: shorter lines of them do not read. [characters]"""
GAP = "  "


def text_table(rows: Sequence[Mapping[str, object]], width: int = SCREEN_WIDTH) -> list[str]:
    r"""Lines of a table: columns of words are wrapped until all fits; columns that still do not fit follow below.

    Parameters
    ----------
    rows : sequence of mapping
        At least one; their keys are the heads of the columns.
    width : int
        Of the lines, as far as single words allow it. [characters]

    Examples
    --------
    >>> print(*text_table([{"pump": 1, "head_m": 26.0}, {"pump": 2, "head_m": 25.5}]), sep="\n")
    pump  head_m
       1    26.0
       2    25.5
    >>> print(*text_table([{"pump": 1, "advice": "pull the pump and look for rags"}], width=24), sep="\n")
    pump  advice
       1  pull the pump and
          look for rags
    """
    names = dict.fromkeys(name for row in rows for name in row)
    columns = [[name, *(shown(row.get(name, "")) for row in rows)] for name in names]
    lines = []
    for block in _blocks(_widths(columns, width), width):
        widths = _widths([columns[place] for place in block], width)
        cells = [_cells(columns[place], its_width) for place, its_width in zip(block, widths, strict=True)]
        for row in zip(*cells, strict=True):
            lines += [GAP.join(line).rstrip() for line in _lines(row, widths)]
    return lines


def folded(text: str, hang: int = 2) -> str:
    """A text whose lines fit the screen, as far as single words allow it; what follows of a line is indented further.

    Parameters
    ----------
    text : str
        Of one line or more.
    hang : int
        By so much more than the beginning of the line. [characters]

    Examples
    --------
    >>> print(folded("  note: " + "word " * 20 + "end"))
      note: word word word word word word word word word word word word word word word word word word
        word word end
    """
    lines = []
    for line in text.splitlines():
        indent = " " * (len(line) - len(line.lstrip()) + hang)
        lines += _wrapped(line, SCREEN_WIDTH, indent)
    return "\n".join(lines)


def shown(value: object) -> str:
    """A value for people: a list by its members, and a dash where there is nothing.

    Examples
    --------
    >>> shown(26.0), shown(["a", "b"]), shown(None), shown({})
    ('26.0', 'a, b', '–', '–')
    """
    if isinstance(value, list):
        return ", ".join(map(shown, value)) or "–"
    return "–" if value is None or value == {} else str(value)


def _widths(columns: Sequence[Sequence[str]], width: int) -> list[int]:
    """Widths of the columns; where they are too wide together the widest gives way, as far as its words allow."""
    widths = [max(map(len, cells)) for cells in columns]
    least = [max(NARROWEST, *(len(word) for cell in cells for word in cell.split() or [""])) for cells in columns]
    while (excess := sum(widths) + len(GAP) * (len(widths) - 1) - width) > 0:
        place = max(range(len(widths)), key=lambda place: widths[place] - least[place])
        if widths[place] <= least[place]:
            break
        widths[place] -= min(excess, widths[place] - least[place])
    return widths


def _blocks(widths: Sequence[int], width: int) -> list[list[int]]:
    """Columns that stand beside each other; each further block begins with the first column again."""
    blocks, used = [[0]], widths[0]
    for place in range(1, len(widths)):
        if used + len(GAP) + widths[place] > width and len(blocks[-1]) > 1:
            blocks.append([0])
            used = widths[0]
        blocks[-1].append(place)
        used += len(GAP) + widths[place]
    return blocks


def _cells(cells: Sequence[str], width: int) -> list[list[str]]:
    """Lines of each cell of a column: to the right under its head, or to the left where some are wrapped."""
    if all(len(cell) <= width for cell in cells):
        return [[cell.rjust(width)] for cell in cells]
    return [_wrapped(cell, width) for cell in cells]


def _wrapped(text: str, width: int, indent: str = "") -> list[str]:
    return wrap(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) or [""]


def _lines(row: Sequence[Sequence[str]], widths: Sequence[int]) -> list[list[str]]:
    """Lines of a row of cells, all as wide as their columns."""
    return [
        [part.ljust(width) for part, width in zip(line, widths, strict=True)]
        for line in zip_longest(*row, fillvalue="")
    ]
