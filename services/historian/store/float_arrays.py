"""Samples in the binary forms of PostgreSQL: rows of COPY, and `float8[]`.

A `float8[]`: five int32 (dimensions 1, no nulls 0, type 701, length, lowest index 1), then for each element its
length in bytes, 8, and its value; all big-endian. It is that of `array_send` and `array_recv` in PostgreSQL's source.
A row of COPY: the number of its fields as int16, then for each its length in bytes as int32, and its value.
"""

import struct

import numpy as np

from wetwell.protocols.arrays import Floats, Integers

COPY_HEADER = b"PGCOPY\n\xff\r\n\0" + struct.pack(">2i", 0, 0)
COPY_END = struct.pack(">h", -1)

_HEADER = struct.Struct(">5i")
_FLOAT8 = 701
_ELEMENT = np.dtype([("size", ">i4"), ("value", ">f8")])


def copy_rows(station: Integers, time_ns: Integers, seq: Integers, quality: Integers, values: Floats) -> bytes:
    """Rows (int4, int8, int8, int2, float8[]) of (n,) samples with (n, columns) values.

    Examples
    --------
    >>> number = np.array([7])
    >>> row = copy_rows(number, number, number, number, np.array([[1.0, 2.0]]))
    >>> len(row), struct.unpack("<2d", from_postgres(row[-44:]))
    (88, (1.0, 2.0))
    """
    width = values.shape[1]
    fields = {"station": ">i4", "time_ns": ">i8", "seq": ">i8", "quality": ">i2"}
    lengths = [(f"{name}_length", ">i4") for name in fields]
    scalars = [each for pair in zip(lengths, fields.items(), strict=True) for each in pair]
    array = np.dtype([("length", ">i4"), ("header", ">i4", 5), ("elements", _ELEMENT, (width,))])
    rows = np.empty(len(values), dtype=np.dtype([("fields", ">i2"), *scalars, ("values", array)]))
    rows["fields"] = len(fields) + 1
    for (name, form), column in zip(fields.items(), (station, time_ns, seq, quality), strict=True):
        rows[f"{name}_length"], rows[name] = np.dtype(form).itemsize, column
    rows["values"]["length"] = _HEADER.size + width * _ELEMENT.itemsize
    rows["values"]["header"] = (1, 0, _FLOAT8, width, 1)
    rows["values"]["elements"]["size"], rows["values"]["elements"]["value"] = 8, values
    return rows.tobytes()


def from_postgres(array: bytes) -> bytes:
    """Little-endian float64 of a `float8[]` without nulls."""
    return np.frombuffer(array, dtype=_ELEMENT, offset=_HEADER.size)["value"].astype("<f8").tobytes()
