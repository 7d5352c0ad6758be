"""Stamps of a block of rows: texts, numbers or Arrow's own times turned into nanoseconds."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from wetwell.protocols.arrays import Flags, Integers
from wetwell.protocols.recordings.importers.times.time_format import TimeFormat, month_of
from wetwell.protocols.timestamps import NS_PER_S

_EXCEL_EPOCH_D = 25_569
"""1970-01-01 in days of Excel."""
_NS_PER_MS = 1_000_000
_DAY_S = 86_400
_NS_OF_UNIT = {
    "epoch_s": NS_PER_S,
    "epoch_ms": _NS_PER_MS,
    "epoch_us": 1_000,
    "epoch_ns": 1,
    "excel": _DAY_S * NS_PER_S,
}
_MOST_S = 9_000_000_000
"""Seconds since 1970 that stamps may have: until 2255."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stamps:
    """Stamps of rows.

    Attributes
    ----------
    time_ns : (n,) int64
        Nanoseconds since 1970, in UTC or of a local clock; 0 where there is none.
    is_utc : (n,) bool
        Whether the row says it in UTC or with an offset.
    is_read : (n,) bool
    """

    time_ns: Integers
    is_utc: Flags
    is_read: Flags

    def take(self, rows: Integers | Flags) -> "Stamps":
        """Stamps of some rows."""
        return Stamps(time_ns=self.time_ns[rows], is_utc=self.is_utc[rows], is_read=self.is_read[rows])


def read_stamps(column: pa.Array, form: TimeFormat | None) -> Stamps:
    """Stamps in a column of texts, numbers or times.

    Parameters
    ----------
    column : (n,) pyarrow.Array
    form : TimeFormat, optional
        Of texts and numbers; a time of Arrow's own needs none.

    Examples
    --------
    >>> stamps = read_stamps(pa.array(["1.1.1970 0.01", "1.1.1970 02.00 +02", "?"]), TimeFormat.of("%d.%m.%Y %H.%M"))
    >>> stamps.time_ns // NS_PER_S, stamps.is_utc, stamps.is_read
    (array([60,  0,  0]), array([False,  True, False]), array([ True,  True, False]))
    """
    is_read = pc.is_valid(column).to_numpy(zero_copy_only=False)
    if pa.types.is_date(column.type) or pa.types.is_timestamp(column.type):
        zone = getattr(column.type, "tz", None)
        time_ns = pc.fill_null(column.cast(pa.timestamp("ns", zone)).cast(pa.int64()), 0).to_numpy()
        return Stamps(time_ns=time_ns, is_utc=np.full(len(column), zone is not None), is_read=is_read)
    if form is None or not (pa.types.is_string(column.type) or form.name in _NS_OF_UNIT):
        none = np.zeros(len(column), dtype=bool)
        return Stamps(time_ns=none.astype(np.int64), is_utc=none, is_read=none)
    if form.name in _NS_OF_UNIT:
        return _of_numbers(column, form.name)
    encoded = column.dictionary_encode()
    unique = _of_texts(encoded.dictionary, form.pattern)
    rows = pc.fill_null(encoded.indices, 0).to_numpy()
    if len(encoded.dictionary) == 0:
        return read_stamps(pa.nulls(len(column), pa.timestamp("ns")), None)
    return Stamps(
        time_ns=unique.time_ns[rows],
        is_utc=unique.is_utc[rows],
        is_read=np.logical_and(unique.is_read[rows], is_read),
    )


def _of_numbers(column: pa.Array, name: str) -> Stamps:
    if pa.types.is_string(column.type):
        texts = pc.replace_substring(pc.utf8_trim_whitespace(column), ",", ".")
        is_number = pc.match_substring_regex(texts, r"^\d+(\.\d*)?$")
        column = pc.if_else(is_number, texts, None).cast(pa.float64())
    numbers = column.cast(pa.float64(), safe=False).fill_null(np.nan).to_numpy(zero_copy_only=False)
    is_read = np.abs(numbers) < (1e5 if name == "excel" else _MOST_S * NS_PER_S / _NS_OF_UNIT[name])
    numbers = np.where(is_read, numbers, 0.0)
    if name == "excel":
        time_ns = np.rint((numbers - _EXCEL_EPOCH_D * is_read) * _DAY_S * 1000.0).astype(np.int64) * _NS_PER_MS
        return Stamps(time_ns=time_ns, is_utc=np.zeros(len(numbers), dtype=bool), is_read=is_read)
    unit_ns = _NS_OF_UNIT[name]
    if unit_ns == 1:
        numbers = np.rint(numbers / 1000.0) * 1000.0  # a float holds them to a microsecond
    whole = np.floor(numbers)
    below_ns = np.rint((numbers - whole) * unit_ns / 1000.0).astype(np.int64) * 1000
    return Stamps(
        time_ns=whole.astype(np.int64) * unit_ns + below_ns, is_utc=np.ones(len(numbers), dtype=bool), is_read=is_read
    )


def _of_texts(texts: pa.Array, pattern: str) -> Stamps:
    groups = pc.extract_regex(texts, pattern)
    is_read = pc.is_valid(groups).to_numpy(zero_copy_only=False)
    text: dict[str, Any] = {field.name: groups.field(place) for place, field in enumerate(groups.type)}
    number = {code: _integers(text[code], is_read) for code in "YymdHIMS" if code in text}
    year = number["Y"] if "Y" in number else 2000 + number["y"]
    month = number["m"] if "m" in number else _by_word(text["b"], is_read, month_of)
    zero = np.zeros(len(texts), dtype=np.int64)
    hour = number.get("H", zero)
    if "I" in number:
        hour = number["I"] % 12 + 12 * _by_word(text["p"], is_read, lambda sign: int(sign in {"p", "P"}))
        is_read &= number["I"] <= 12
    minute, second = number.get("M", zero), number.get("S", zero)
    is_read &= (month >= 1) & (month <= 12) & (hour < 24) & (minute < 60) & (second < 60)
    first_d = (12 * (year - 1970) + np.clip(month, 1, 12) - 1).astype("datetime64[M]").astype("datetime64[D]")
    days = first_d.astype(np.int64) + number["d"] - 1
    is_read &= (number["d"] >= 1) & (days < _next_month_d(year, month)) & (np.abs(days) < 106_000)
    below_ns = (
        _integers(
            pc.utf8_rpad(text["f"], 9, "0"), is_read & (pc.utf8_length(text["f"]).to_numpy(zero_copy_only=False) > 0)
        )
        if "f" in text
        else zero
    )
    offset_s = _by_word(text["z"], is_read, _offset_s)
    seconds = days * _DAY_S + hour * 3600 + minute * 60 + second - offset_s
    is_utc = np.asarray(pc.fill_null(pc.not_equal(text["z"], ""), False).to_numpy(zero_copy_only=False)) & is_read
    return Stamps(time_ns=np.where(is_read, seconds * NS_PER_S + below_ns, 0), is_utc=is_utc, is_read=is_read)


def _next_month_d(year: Integers, month: Integers) -> Integers:
    months = 12 * (year - 1970) + np.clip(month, 1, 12)
    return months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)


def _integers(texts: pa.Array, is_read: Flags) -> Integers:
    known = pc.if_else(pa.array(is_read), texts, "0")
    known = pc.if_else(pc.equal(known, ""), "0", known)
    return np.asarray(known.cast(pa.int64()).to_numpy(zero_copy_only=False), dtype=np.int64)


def _by_word(texts: pa.Array, is_read: Flags, number_of: Any) -> Integers:
    """Numbers that words stand for; there are few different words."""
    encoded = pc.if_else(pa.array(is_read), texts, "").dictionary_encode()
    numbers = np.array([number_of(word) for word in encoded.dictionary.to_pylist()], dtype=np.int64)
    return np.asarray(numbers[encoded.indices.to_numpy()])


def _offset_s(text: str) -> int:
    """Seconds that a clock with an offset is before UTC.

    Examples
    --------
    >>> _offset_s("+02:00"), _offset_s("-0530"), _offset_s("Z")
    (7200, -19800, 0)
    """
    if text[:1] not in {"+", "-"}:
        return 0
    seconds = 3600 * int(text[1:3]) + 60 * int(text[3:].lstrip(":") or 0)
    return -seconds if text[0] == "-" else seconds
