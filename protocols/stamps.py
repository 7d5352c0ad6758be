"""Time stamps: nanoseconds since 1970 in UTC inside, ISO 8601 with a Z outside."""

from datetime import UTC, datetime
from typing import Literal

import numpy as np
import numpy.typing as npt

NS_PER_S = 1_000_000_000


def to_iso(stamp_ns: int) -> str:
    """ISO 8601 text of a stamp, as short as it can be without loss.

    Examples
    --------
    >>> to_iso(0)
    '1970-01-01T00:00:00Z'
    >>> to_iso(1_500_000_000)
    '1970-01-01T00:00:01.500Z'
    """
    unit: Literal["s", "ms", "ns"] = "s" if stamp_ns % NS_PER_S == 0 else "ms" if stamp_ns % 1_000_000 == 0 else "ns"
    return f"{np.datetime_as_string(np.datetime64(stamp_ns, 'ns'), unit=unit)}Z"


def from_iso(text: str) -> int:
    """Stamp of an ISO 8601 text; a text without zone is taken as UTC.

    Raises
    ------
    ValueError
        If the text is not ISO 8601.

    Examples
    --------
    >>> from_iso("2025-01-01T01:00:00+01:00") == from_iso("2025-01-01T00:00:00Z")
    True
    """
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    whole_s = moment.astimezone(UTC).replace(microsecond=0)
    return int(whole_s.timestamp()) * NS_PER_S + moment.microsecond * 1000


def to_iso_array(stamps_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.str_]:
    """ISO 8601 texts of (n,) stamps, all with the same number of decimals."""
    unit: Literal["s", "ms", "ns"] = (
        "s" if not np.any(stamps_ns % NS_PER_S) else "ms" if not np.any(stamps_ns % 1_000_000) else "ns"
    )
    texts = np.datetime_as_string(stamps_ns.astype("datetime64[ns]"), unit=unit)
    return np.char.add(texts, "Z")
