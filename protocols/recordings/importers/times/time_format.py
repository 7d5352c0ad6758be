"""Forms in which exports write a stamp: `strptime` codes, seconds to nanoseconds since 1970, days of Excel."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

NUMERIC = ("epoch_s", "epoch_ms", "epoch_us", "epoch_ns", "excel")
"""Forms that are one number: seconds to nanoseconds since 1970 in UTC, days since 30 December 1899 in local time."""

_MONTHS = (
    "jan tammi ene gen",
    "feb fév fev helmi",
    "mar mär mrz maalis",
    "apr avr huhti abr",
    "may mai touko mei maj mag",
    "jun juin kesä giu",
    "jul juil heinä lug",
    "aug aoû aou elo ago",
    "sep syys set",
    "oct okt loka ott out",
    "nov marras",
    "dec dez déc joulu dic des",
)
_CODES = {
    "Y": r"(?P<Y>\d{4})",
    "y": r"(?P<y>\d{2})",
    "m": r"(?P<m>\d{1,2})",
    "b": r"(?P<b>[^\d\s./,-]+)\.?",
    "d": r"(?P<d>\d{1,2})",
    "H": r"(?P<H>\d{1,2})",
    "I": r"(?P<I>\d{1,2})",
    "M": r"(?P<M>\d{1,2})",
    "S": r"(?P<S>\d{1,2})(?:[.,:](?P<f>\d{1,9}))?",
    "p": r"(?P<p>[AaPp])\.?[Mm]\.?",
}
_ZONE = r"(?:\s*(?P<z>Z|UTC|GMT|[+-]\d{2}:?\d{2}|[+-]\d{2}))?"
_DATES = (
    *("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d.%m.%y", "%d/%m/%Y", "%m/%d/%Y", "%d/%m/%y", "%m/%d/%y"),
    *("%d-%m-%Y", "%m-%d-%Y", "%d-%b-%Y", "%d-%b-%y", "%d/%b/%Y", "%d %b %Y", "%b %d %Y", "%b %d, %Y", "%Y%m%d"),
)
_TIMES = ("%H:%M:%S", "%H:%M", "%H.%M.%S", "%H.%M", "%I:%M:%S %p", "%I:%M %p", "%H%M%S", "%H%M")
_LIKELY = 0.8
"""A form that fits a smaller part of the stamps is not that of the file."""
_MOST_TRIED = 400


@dataclass(frozen=True, slots=True)
class TimeFormat:
    """A form of stamps: its name, and the regular expression whose groups are its codes; empty for a number."""

    name: str
    pattern: str

    @classmethod
    def of(cls, name: str) -> Self:
        """Form of a name.

        A fraction may follow the seconds, and an offset the whole; a date alone is its midnight; a T may stand for
        the blank between date and time.

        Raises
        ------
        ValueError
            If it is not in `NUMERIC` and holds no date.
        """
        if name in NUMERIC:
            return cls(name, "")
        codes = re.findall(r"%(.)", name)
        unknown = [code for code in codes if code not in _CODES]
        if unknown:
            raise ValueError(f"got '%{unknown[0]}' in '{name}', known are {', '.join('%' + code for code in _CODES)}")
        if sorted(code for code in codes if code in "Yymbd") not in (
            ["Y", "d", "m"],
            ["Y", "b", "d"],
            ["d", "m", "y"],
            ["b", "d", "y"],
        ):
            raise ValueError(
                f"got '{name}', must be {', '.join(NUMERIC)}, or day, month and year such as %d.%m.%Y %H:%M"
            )
        date, *time = re.split(r"([T ,-]*)(?=%[HI])", name, maxsplit=1)
        pattern = _pattern(date) + (f"(?:{_pattern(''.join(time))})?" if time else "")
        return cls(name, rf"^\s*{pattern}{_ZONE}\s*$")


def _pattern(text: str) -> str:
    pieces = re.split(r"(%.)", text)
    literal = {" ": r"[T\s]\s*", "T": r"[T\s]\s*"}
    return "".join(
        _CODES[piece[1]] if piece.startswith("%") else "".join(literal.get(sign, re.escape(sign)) for sign in piece)
        for piece in pieces
    )


_DATE_PATTERNS = {date: re.compile(rf"\s*{_pattern(date)}") for date in _DATES}
_GAP = re.compile(r"T|\s-\s|,\s*|\s+|")
_GAP_NAMES = {"": " ", "T": " ", ",": ", ", "-": " - "}
_TIME_PATTERNS = {time: re.compile(rf"{_pattern(time)}{_ZONE}\s*") for time in (*_TIMES, "")}


def month_of(text: str) -> int:
    """Number of a month by its name in one of the languages of exports, from 1; 0 if it is none.

    Examples
    --------
    >>> month_of("Nov"), month_of("Dez."), month_of("toukokuu"), month_of("x")
    (11, 12, 5, 0)
    """
    found = [
        (len(name), n)
        for n, names in enumerate(_MONTHS, start=1)
        for name in names.split()
        if text.lower().startswith(name)
    ]
    return max(found, default=(0, 0))[1]


def looks_like_time(text: str) -> bool:
    """Whether a text is a stamp with a date, in one of the forms that are known.

    Examples
    --------
    >>> looks_like_time("15.11.2024 12:30"), looks_like_time("PS07.LT01"), looks_like_time("3.21")
    (True, False, False)
    """
    return next(_forms(text), None) is not None


def find_formats(texts: Sequence[str]) -> list[str]:
    """Forms of stamps, at most two; two where day and month cannot be told apart, none where none is known.

    Of two orders of day and month the one counts whose days lie far closer together.

    Examples
    --------
    >>> find_formats(["31.01.2025 06:00:00"]), find_formats(["01/02/2025 06:00", "01/02/2025 06:15"])
    (['%d.%m.%Y %H:%M:%S'], ['%d/%m/%Y %H:%M', '%m/%d/%Y %H:%M'])
    """
    some = texts[:: max(len(texts) // _MOST_TRIED, 1)]
    numeric = _numeric_format(some)
    if numeric:
        return [numeric]
    days: dict[str, list[int]] = {}
    for text in some:
        for name, day in _forms(text):
            days.setdefault(name, []).append(day)
    most = max((len(fitting) for fitting in days.values()), default=0)
    found = [name for name in days if len(days[name]) == most >= _LIKELY * len(some)]
    orders = [name for name in found if sorted(name) == sorted(found[0])]
    spans = [max(days[name]) - min(days[name]) for name in orders]
    is_plain = len(orders) == 2 and max(spans) > 5 * max(min(spans), 1)
    return [orders[spans.index(min(spans))]] if is_plain else orders


def _forms(text: str) -> Iterator[tuple[str, int]]:
    """Forms that a text has, each with its day, counted roughly; a day and a month that there are."""
    for date, date_pattern in _DATE_PATTERNS.items():
        match = date_pattern.match(text)
        if match is None:
            continue
        groups = match.groupdict()
        year, day = int(groups.get("Y") or groups["y"]), int(groups["d"])
        month = int(groups["m"]) if "m" in groups else month_of(groups["b"])
        gap = _GAP.match(text, match.end())
        if gap is None or not (1 <= month <= 12 and 1 <= day <= 31):
            continue
        for time, time_pattern in _TIME_PATTERNS.items():
            if time_pattern.fullmatch(text, gap.end()) and (gap[0] or not time or date == "%Y%m%d"):
                yield (
                    date + (_GAP_NAMES[gap[0].strip()] if time and gap[0] else "") + time,
                    372 * year + 31 * month + day,
                )


def _numeric_format(texts: Sequence[str]) -> str | None:
    numbers = sorted(
        float(text.replace(",", ".")) for text in texts if re.fullmatch(r"\s*\d{5,19}(?:[.,]\d*)?\s*", text)
    )
    if len(numbers) < max(_LIKELY * len(texts), 1):
        return None
    limits = {
        "epoch_ns": (1e17, 1e19),
        "epoch_us": (1e14, 1e16),
        "epoch_ms": (1e11, 1e13),
        "epoch_s": (1e8, 1e10),
        "excel": (2e4, 8e4),
    }
    middle = numbers[len(numbers) // 2]
    return next((name for name, (low, high) in limits.items() if low <= middle < high), None)
