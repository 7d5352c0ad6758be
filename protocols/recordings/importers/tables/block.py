"""A file of an export as named columns, in blocks of rows, whatever its kind."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from wetwell.protocols.arrays import Integers
from wetwell.protocols.recordings.importers.refusals import Refusals


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Some rows of a file.

    Attributes
    ----------
    columns : mapping of header to (n,) pyarrow.Array
        Texts, numbers or times.
    lines : (n,) int64
        Line of each row in the file, from 1; in Parquet its row.
    """

    columns: Mapping[str, pa.Array]
    lines: Integers


class ExportFile(ABC):
    """A file of an export.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Headers of the columns; the second of the same name is called "name (2)".
    notes : tuple of tuple of str
        Cells of the lines between header and data, such as units.
    decimal : str
        Decimal sign of its texts.
    assumed : mapping of str to str
        What was found by looking.
    """

    path: Path
    names: tuple[str, ...]
    notes: tuple[tuple[str, ...], ...]
    decimal: str
    assumed: Mapping[str, str]

    @abstractmethod
    def needed_bytes(self, signals: int) -> int:
        """Memory that so many signals of the file take at most, roughly. [B]."""

    def ends(self, wanted: Collection[str]) -> list[Block]:
        """Some rows with the wanted columns: those of the first block, at least."""
        return [next(iter(self.blocks(wanted, Refusals())), Block(columns={}, lines=np.zeros(0, dtype=np.int64)))]

    @abstractmethod
    def blocks(self, wanted: Collection[str], refusals: Refusals) -> Iterator[Block]:
        """Yield the rows with the wanted columns; rows that are none go to `refusals`."""


def texts_of(column: pa.Array) -> pa.Array:
    """A column as texts without blanks around them; whole numbers without decimals, nothing as nothing."""
    if pa.types.is_dictionary(column.type):
        column = column.dictionary_decode()
    if pa.types.is_floating(column.type):
        whole = pc.and_(pc.is_finite(column), pc.less(pc.abs(column), 1e15))
        is_whole = pc.and_(whole, pc.equal(pc.round(column), column))
        integers = pc.if_else(is_whole, column, 0.0).cast(pa.int64()).cast(pa.string())
        return pc.if_else(is_whole, integers, column.cast(pa.string()))
    return pc.utf8_trim_whitespace(column.cast(pa.string()))


def without_doubles(names: Collection[str]) -> tuple[str, ...]:
    """Headers of which none stands twice; an empty one gets its number.

    Examples
    --------
    >>> without_doubles(["time", "Q", "Q", ""])
    ('time', 'Q', 'Q (2)', 'column 4')
    """
    seen: dict[str, int] = {}
    single = []
    for number, raw in enumerate(names, start=1):
        name = raw.strip() or f"column {number}"
        seen[name] = seen.get(name, 0) + 1
        single.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(single)
