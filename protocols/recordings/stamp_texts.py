"""Time stamps of a recording as text."""

from typing import Literal

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Integers
from wetwell.protocols.timestamps import NS_PER_S


def to_iso_array(stamps_ns: Integers) -> npt.NDArray[np.str_]:
    """ISO 8601 texts of (n,) stamps, all with the same number of decimals."""
    unit: Literal["s", "ms", "ns"] = (
        "s" if not np.any(stamps_ns % NS_PER_S) else "ms" if not np.any(stamps_ns % 1_000_000) else "ns"
    )
    texts = np.datetime_as_string(stamps_ns.astype("datetime64[ns]"), unit=unit)
    return np.char.add(texts, "Z")
