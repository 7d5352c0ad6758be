"""Numbers out of cells: decimal comma, thousands, empty cells, words."""

import re
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.recordings.importers.tables.block import texts_of

EMPTY = ("", "nan", "null", "none", "n/a", "#n/a", "na", "-", "--", "---")
"""What stands where there is no value, in small letters."""

_THOUSANDS = "[\\s\u00a0\u202f'’{}]"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Cells of a column.

    Attributes
    ----------
    numbers : (n,) float64
        NaN where there is none.
    is_empty : (n,) bool
        Nothing stands there, or a word for nothing.
    is_word : (n,) bool
        A text that is no number.
    column : pyarrow.Array
        The cells as they were.
    """

    numbers: Floats
    is_empty: Flags
    is_word: Flags
    column: pa.Array

    def take(self, rows: Integers) -> "Cells":
        """Cells of some rows."""
        return Cells(
            numbers=self.numbers[rows],
            is_empty=self.is_empty[rows],
            is_word=self.is_word[rows],
            column=self.column.take(pa.array(rows)),
        )


def read_cells(column: pa.Array, decimal: str) -> Cells:
    """Numbers and words of a column.

    Examples
    --------
    >>> cells = read_cells(pa.array(["1.234,5", " 7 ", "EIN", ""]), ",")
    >>> cells.numbers, cells.is_word.tolist(), cells.is_empty.tolist()
    (array([1234.5,    7. ,    nan,    nan]), [False, False, True, False], [False, False, False, True])
    """
    if pa.types.is_boolean(column.type):
        column = column.cast(pa.int8())
    if pa.types.is_integer(column.type) or pa.types.is_floating(column.type) or pa.types.is_decimal(column.type):
        typed = pc.fill_null(column.cast(pa.float64()), np.nan).to_numpy(zero_copy_only=False)
        no_words = np.zeros(len(column), dtype=bool)
        return Cells(numbers=typed, is_empty=np.isnan(typed), is_word=no_words, column=column)
    texts = pc.fill_null(texts_of(column), "")
    quick = _all_numbers(texts, decimal)
    if quick is not None:
        none = np.zeros(len(column), dtype=bool)
        return Cells(numbers=quick, is_empty=none, is_word=none, column=texts)
    pattern = rf"^[+-]?(\d+{re.escape(decimal)}?\d*|{re.escape(decimal)}\d+)([eE][+-]?\d+)?$"
    is_plain = pc.match_substring_regex(texts, pattern)
    plain = pc.if_else(is_plain, texts, "nan")
    numbers = (pc.replace_substring(plain, decimal, ".") if decimal != "." else plain).cast(pa.float64()).to_numpy()
    others = np.flatnonzero(~is_plain.to_numpy(zero_copy_only=False))
    is_empty, is_word = np.zeros(len(column), dtype=bool), np.zeros(len(column), dtype=bool)
    if others.size:
        numbers = numbers.copy()
        encoded = texts.take(pa.array(others)).dictionary_encode()
        words = encoded.dictionary.to_pylist()
        places = encoded.indices.to_numpy()
        numbers[others] = np.array([_number(word, decimal) for word in words])[places]
        is_empty[others] = np.array([word.lower() in EMPTY for word in words])[places]
        is_word[others] = np.isnan(numbers[others]) & ~is_empty[others]
    return Cells(numbers=numbers, is_empty=is_empty, is_word=is_word, column=texts)


def _all_numbers(texts: pa.Array, decimal: str) -> Floats | None:
    """Numbers of texts that are numbers throughout, without signs between thousands; None if one is not."""
    if decimal != ".":
        if pc.any(pc.match_substring(texts, ".")).as_py():
            return None
        texts = pc.replace_substring(texts, decimal, ".")
    try:
        numbers: Floats = texts.cast(pa.float64()).to_numpy()
    except pa.ArrowInvalid:
        return None
    return None if np.isnan(numbers).any() else numbers


def _number(text: str, decimal: str) -> float:
    """Number with signs between its thousands; NaN if it is none.

    Examples
    --------
    >>> _number("-12 345,6", ","), _number("1,234", "."), _number("1,2", ".")
    (-12345.6, 1234.0, nan)
    """
    between = _THOUSANDS.format("." if decimal == "," else ",")
    if not re.fullmatch(rf"[+-−]?\d{{1,3}}({between}\d{{3}})+({re.escape(decimal)}\d*)?", text):
        return float("nan")
    return float(re.sub(between, "", text).replace(decimal, ".").replace("−", "-"))
