"""Time stamps: nanoseconds since 1970 in UTC inside, ISO 8601 with a Z outside."""

import re
from datetime import UTC, datetime, timedelta

NS_PER_S = 1_000_000_000
NS_PER_DAY = 86_400 * NS_PER_S
LEARNING_S = 6.0 * 3600.0
"""The first six hours are healthy: a detector learns from them, no fault begins in them, nothing is scored. [s]"""
MAX_STAMP_NS = 2**63 - 1
"""In the year 2262; the first stamp is as far before 1970."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_BELOW_MICROSECOND = re.compile(r"[.,]\d{6}(\d{1,3})")


def to_iso(stamp_ns: int) -> str:
    """ISO 8601 text of a stamp, as short as it can be without loss.

    Examples
    --------
    >>> to_iso(0)
    '1970-01-01T00:00:00Z'
    >>> to_iso(1_500_000_000)
    '1970-01-01T00:00:01.500Z'
    """
    second, rest_ns = divmod(stamp_ns, NS_PER_S)
    whole = (_EPOCH + timedelta(seconds=second)).isoformat()[:19]
    if rest_ns == 0:
        return f"{whole}Z"
    return f"{whole}.{rest_ns // 1_000_000:03}Z" if rest_ns % 1_000_000 == 0 else f"{whole}.{rest_ns:09}Z"


def from_iso(text: str) -> int:
    """Stamp of an ISO 8601 text; a text without zone is taken as UTC.

    Raises
    ------
    ValueError
        If the text is not ISO 8601, or lies outside of the years 1678 to 2262.

    Examples
    --------
    >>> from_iso("2025-01-01T01:00:00+01:00") == from_iso("2025-01-01T00:00:00Z")
    True
    >>> from_iso("1970-01-01T00:00:00.000000001Z")
    1
    """
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    since = moment - _EPOCH
    stamp_ns = (since.days * 86_400 + since.seconds) * NS_PER_S + since.microseconds * 1000
    if ("." in text or "," in text) and (digits := _BELOW_MICROSECOND.search(text)):
        stamp_ns += int(digits[1].ljust(3, "0"))
    if abs(stamp_ns) > MAX_STAMP_NS:
        raise ValueError(f"time must lie in the years 1678 to 2262, got {text!r}")
    return stamp_ns


def has_zone(text: str) -> bool:
    """Whether an ISO 8601 text says its zone.

    Raises
    ------
    ValueError
        If the text is not ISO 8601.

    Examples
    --------
    >>> has_zone("2025-01-01T01:00:00+01:00"), has_zone("2025-01-01T00:00:00Z"), has_zone("2025-01-01T00:00:00")
    (True, True, False)
    """
    return text.endswith("Z") or datetime.fromisoformat(text).tzinfo is not None
