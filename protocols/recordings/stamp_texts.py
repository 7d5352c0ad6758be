"""Time stamps of a recording as text."""

from typing import Any, Literal

import numpy as np

from wetwell.protocols.arrays import Integers
from wetwell.protocols.recordings.layout import texts_of_a_length
from wetwell.protocols.timestamps import NS_PER_S


def iso_texts(stamps_ns: Integers) -> Any:
    """Arrow array of ISO 8601 texts of (n,) stamps, all with the same number of decimals, and so of one length."""
    unit: Literal["s", "ms", "ns"] = (
        "s" if not np.any(stamps_ns % NS_PER_S) else "ms" if not np.any(stamps_ns % 1_000_000) else "ns"
    )
    texts = np.datetime_as_string(stamps_ns.astype("datetime64[ns]"), unit=unit, timezone="UTC")
    length = len(texts[0]) if texts.size else 0
    return texts_of_a_length(texts.astype(f"S{length}"), texts.size, length)
