"""Columns as Arrow has them, and how they lie in Parquet: what is made a day of seconds at a time must be quick."""

import io
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet

from wetwell.protocols.arrays import Integers

STAMP = pa.timestamp("ns", tz="UTC")
BATCH_ROWS = 1 << 16
"""Rows that Parquet takes up in one go; its own 1024 take a quarter longer."""
MOST_CHANGES = 0.5
"""Where more of the values differ from the one before, to make text of each takes no longer. [1]"""
ZSTD_LEVEL = -1
"""The first of the quick levels: a quarter less time than 1, for files that are a tenth longer."""


def arrow_of(values: npt.NDArray[Any], kind: Any = None) -> Any:
    """Arrow array of (n,) values; numbers are not copied, and a text that stands for all is made once.

    Arrow's own way makes each text by itself, and loads pandas, where it is there, to ask whether this is a series.
    """
    size = values.size
    if _is_number(values):
        kind = kind or (pa.float64() if values.dtype == np.float64 else pa.int64())
        return pa.Array.from_buffers(kind, size, [None, pa.py_buffer(np.ascontiguousarray(values))])
    if _is_one_text(values):
        text = str(values[0]).encode()
        return texts_of_a_length(text * size, size, len(text))
    return pa.array(values)


def texts_of_a_length(data: Any, size: int, length: int) -> Any:
    """Arrow array of so many texts of one length, which lie in a buffer one after the other."""
    ends = np.arange(size + 1, dtype=np.int32) * np.int32(length)
    return pa.StringArray.from_buffers(size, pa.py_buffer(ends), pa.py_buffer(data))


def texts_of(values: npt.NDArray[Any]) -> Any:
    """Arrow array of (n,) values as CSV has them; equal numbers in a row, as of a pump that stands, become text once.

    Numbers that change each second stay numbers, of which Arrow's writer makes text itself.
    """
    array = arrow_of(values)
    if not _is_number(values):
        return array
    bits = np.ascontiguousarray(values).view(np.int64)
    begins = np.flatnonzero(np.diff(bits, prepend=~bits[:1]))
    if begins.size > values.size * MOST_CHANGES:
        return array
    lengths = np.diff(begins, append=values.size)
    return array.take(arrow_of(begins)).cast(pa.string()).take(arrow_of(np.repeat(np.arange(begins.size), lengths)))


def parquet_table(
    time_ns: Integers, columns: Mapping[str, npt.NDArray[Any]], metadata: Mapping[bytes, bytes] | None
) -> pa.Table:
    """Table of a block for `parquet_writer`: numbers are said to be never null, texts are places in a dictionary."""
    arrays = [arrow_of(time_ns, STAMP), *map(_coded, columns.values())]
    fields = [pa.field("time", STAMP, nullable=False)]
    fields += [
        pa.field(name, array.type, nullable=not _is_number(values))
        for (name, values), array in zip(columns.items(), arrays[1:], strict=True)
    ]
    return pa.table(arrays, schema=pa.schema(fields, metadata=metadata))


def parquet_writer(file: io.BufferedIOBase, schema: pa.Schema) -> Any:
    """Writer of blocks of this schema, a row group each.

    Arrow's schema is left out, so that texts are read back as such, not as places in a dictionary. A dictionary of
    measured numbers would be as long as they are, and their least and largest tell little.
    """
    texts = [field.name for field in schema if pa.types.is_dictionary(field.type)]
    writer = pa.parquet.ParquetWriter(
        file,
        schema,
        compression="zstd",
        compression_level=ZSTD_LEVEL,
        use_dictionary=texts,
        write_statistics=["time"],
        column_encoding={"time": "DELTA_BINARY_PACKED"},
        store_schema=False,
        write_batch_size=BATCH_ROWS,
    )
    if schema.metadata:
        writer.add_key_value_metadata(schema.metadata)
    return writer


def _coded(values: npt.NDArray[Any]) -> Any:
    if _is_one_text(values):
        places = pa.py_buffer(np.zeros(values.size, dtype=np.int32))
        return pa.DictionaryArray.from_arrays(
            pa.Array.from_buffers(pa.int32(), values.size, [None, places]), arrow_of(values[:1])
        )
    array = arrow_of(values)
    return array.dictionary_encode() if pa.types.is_string(array.type) else array


def _is_number(values: npt.NDArray[Any]) -> bool:
    return values.dtype in (np.float64, np.int64)


def _is_one_text(values: npt.NDArray[Any]) -> bool:
    """Whether it is one text, seen n times."""
    return values.size > 0 and values.dtype.kind == "U" and values.strides == (0,)
