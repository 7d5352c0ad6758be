"""How a text file is written: encoding, delimiter, decimal sign, found by looking at its beginning and its end."""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence

DELIMITERS = ("\t", ";", "|", ",")
_OFTEN = 0.8
_COMMA = re.compile(r"[+-]?\d{1,3}(?:[. \u00a0\u202f'’]\d{3})*,\d+|[+-]?\d+,\d+")
_POINT = re.compile(r"[+-]?\d{1,3}(?:[, \u00a0\u202f'’]\d{3})*\.\d+|[+-]?\d+\.\d+")
_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


def find_encoding(samples: Sequence[bytes]) -> str:
    """Encoding of some pieces of a file, the first of them its beginning.

    A mark at the beginning counts; then zeros, of which UTF-16 is full; then whether it can be UTF-8; else it is
    taken for Windows-1252, of which ISO-8859-1 is a part.

    Examples
    --------
    >>> [find_encoding(["m³/h".encode(name)]) for name in ("utf-8", "iso-8859-1", "utf-16-le")]
    ['utf-8', 'cp1252', 'utf-16-le']
    """
    head = samples[0]
    for mark, name in _MARKS.items():
        if head.startswith(mark):
            return name
    if head[:200].count(b"\0") > len(head[:200]) / 4:
        return "utf-16-le" if head[1:200:2].count(b"\0") > head[0:200:2].count(b"\0") else "utf-16-be"
    try:
        for sample in samples:
            codecs.getincrementaldecoder("utf-8")().decode(sample.lstrip(bytes(range(0x80, 0xC0))))
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def lines_of(text: str) -> list[str]:
    """Lines of a text, without those signs that `str.splitlines` takes for ends of lines as well."""
    return re.split(r"\r\n|\n|\r", text)


def find_delimiter(lines: Sequence[str]) -> str | None:
    """Delimiter that cuts most lines into the same number of fields, and into most; None if none does.

    Examples
    --------
    >>> find_delimiter(["time;level;flow", "15.11.2024 12:00;3,21;4,5", "15.11.2024 12:01;3,2;4,6"])
    ';'
    """
    said = re.fullmatch(r"\s*sep=(.)\s*", lines[0]) if lines else None
    if said:
        return said[1]
    filled = [line for line in lines if line.strip()]
    ranks: dict[str, tuple[bool, int, int]] = {}
    for delimiter in DELIMITERS:
        widths = Counter(len(row) for row in csv.reader(filled, delimiter=delimiter) if len(row) > 1)
        if widths:
            width, alike = widths.most_common(1)[0]
            often = alike >= _OFTEN * len(filled)
            ranks[delimiter] = (often, width if often else alike, -DELIMITERS.index(delimiter))
    return max(ranks, key=lambda delimiter: ranks[delimiter]) if ranks else None


def find_decimal(cells: Iterable[str]) -> str | None:
    """Decimal sign of most cells that are numbers with decimals; None if there are none.

    Examples
    --------
    >>> find_decimal(["1.234,5", "0,5"]), find_decimal(["1,234.5"]), find_decimal(["12"])
    (',', '.', None)
    """
    trimmed = [cell.strip() for cell in cells]
    commas = sum(_COMMA.fullmatch(cell) is not None for cell in trimmed)
    points = sum(_POINT.fullmatch(cell) is not None for cell in trimmed)
    if commas == points == 0:
        return None
    return "," if commas > points else "."
