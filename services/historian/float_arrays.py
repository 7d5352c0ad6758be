"""Packed float64 in the binary form of PostgreSQL's `float8[]`, and back.

The form: five int32 (dimensions 1, no nulls 0, type 701, length, lowest index 1), then for each element its length in
bytes, 8, and its value; all big-endian. It is that of `array_send` and `array_recv` in PostgreSQL's source.
"""

import struct
from collections.abc import Sequence

import numpy as np

_HEADER = struct.Struct(">5i")
_FLOAT8 = 701
_ELEMENT = np.dtype([("size", ">i4"), ("value", ">f8")])


def to_postgres(rows: Sequence[bytes]) -> list[bytes]:
    """Arrays of rows of little-endian float64.

    Examples
    --------
    >>> (array,) = to_postgres([struct.pack("<2d", 1.0, 2.0)])
    >>> len(array), struct.unpack("<2d", from_postgres(array))
    (44, (1.0, 2.0))
    """
    arrays = []
    for row in rows:
        elements = np.empty(len(row) // 8, dtype=_ELEMENT)
        elements["size"] = 8
        elements["value"] = np.frombuffer(row, dtype="<f8")
        arrays.append(_HEADER.pack(1, 0, _FLOAT8, len(elements), 1) + elements.tobytes())
    return arrays


def from_postgres(array: bytes) -> bytes:
    """Little-endian float64 of an array without nulls."""
    return np.frombuffer(array, dtype=_ELEMENT, offset=_HEADER.size)["value"].astype("<f8").tobytes()
