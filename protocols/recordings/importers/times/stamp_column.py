"""Column of the stamps of a file, and the form in which it writes them."""

from collections.abc import Sequence

import pyarrow as pa
import pyarrow.compute as pc

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.recordings.importers.tables.block import Block, ExportFile, texts_of
from wetwell.protocols.recordings.importers.times.time_format import TimeFormat, find_formats


def stamp_column(block: Block, time: str, date: str | None) -> pa.Array:
    """Stamps of a block as they stand there; of a date and a time of day the two together."""
    if date is None:
        return block.columns[time]
    day = texts_of(block.columns[date])
    if pa.types.is_timestamp(block.columns[date].type):
        day = pc.utf8_slice_codeunits(day, 0, 10)
    return pc.binary_join_element_wise(day, texts_of(block.columns[time]), " ")


def stamp_texts(file: ExportFile, time: str, date: str | None) -> list[str]:
    """Some stamps of a file as texts, from its beginning and its end; none if they are times already."""
    texts: list[str] = []
    for block in file.ends([time, *([date] if date else [])]):
        if time in block.columns:
            column = stamp_column(block, time, date)
            if not (pa.types.is_timestamp(column.type) or pa.types.is_date(column.type)):
                texts += [text for text in texts_of(column).to_pylist() if text]
    return texts


def form_of(files: Sequence[ExportFile], time: str, date: str | None) -> TimeFormat | None:
    """Form of the stamps of some files, found by looking; None if they are times already.

    Raises
    ------
    ConfigError
        If it is not known, or day and month cannot be told apart.
    """
    ends = files if len(files) == 1 else [files[0], files[-1]]
    texts = [text for file in ends for text in stamp_texts(file, time, date)]
    if not texts:
        return None
    found = find_formats(texts)
    if len(found) != 1:
        rule = f"could be {' or '.join(found)}" if found else "is of no form that is known"
        raise ConfigError(f"time_format: missing, {texts[0]!r} in {files[0].path} {rule}")
    return TimeFormat.of(found[0])
