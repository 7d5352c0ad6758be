"""What an export looks like: its layout, its columns, its tags with some of their values."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.importers.refusals import Refusals
from wetwell.protocols.recordings.importers.signals.numbers import read_cells
from wetwell.protocols.recordings.importers.tables.block import Block, ExportFile, texts_of
from wetwell.protocols.recordings.importers.times.stamp_column import stamp_column, stamp_texts
from wetwell.protocols.recordings.importers.times.stamps import read_stamps
from wetwell.protocols.recordings.importers.times.time_format import TimeFormat, find_formats, looks_like_time
from wetwell.protocols.timestamps import NS_PER_S

_TAG_HEADERS = (
    *("tag", "tagname", "tag_name", "tagpath", "varname", "variable", "point", "pointid", "point_id", "signal"),
    *("name", "messstelle", "kanal", "channel", "kennung", "tunnus", "positio", "piste", "repère", "point name"),
)
_VALUE_HEADERS = ("value", "varvalue", "wert", "messwert", "valeur", "arvo", "valor", "val", "vvalue", "tagval")
_QUALITY_HEADERS = ("quality", "qualität", "qualitaet", "status", "validity", "qualité", "laatu", "dataintegrity")
_UNIT_HEADERS = ("unit", "units", "einheit", "unité", "yksikkö", "eu", "engunits")
_MOST_BLOCKS = 8
"""Blocks of each file that are looked at."""
_LIKELY = 0.8
_TIME_HEADER = re.compile(r"time|zeit|date|aika|heure|epoch|stamp")
_TIME_OF_DAY = re.compile(r"\d{1,2}[:.]\d{2}([:.]\d{2})?([.,]\d+)?(\s*[AaPp]\.?[Mm]\.?)?")


@dataclass(slots=True, kw_only=True)
class Seen:
    """What was seen of a tag: how its unit is written, its numbers and its words."""

    unit_text: str = ""
    numbers: list[Floats] = field(default_factory=list)
    words: Counter[str] = field(default_factory=Counter)

    def add(self, column: pa.Array, decimal: str) -> None:
        """See some cells."""
        if pa.types.is_timestamp(column.type) or pa.types.is_date(column.type):
            return
        cells = read_cells(column, decimal)
        self.numbers.append(cells.numbers)
        if cells.is_word.any():
            self.words.update(_counts(cells.column.take(pa.array(np.flatnonzero(cells.is_word)))))

    @property
    def span(self) -> tuple[float, float] | None:
        """Least and greatest number; None if there is none."""
        known = np.concatenate([part[np.isfinite(part)] for part in self.numbers]) if self.numbers else np.zeros(0)
        return (float(known.min()), float(known.max())) if known.size else None


@dataclass(slots=True, kw_only=True)
class Look:
    """What was seen of an export.

    Attributes
    ----------
    time, date, tag, value, quality, unit : str
        Headers of the columns, empty where there is none.
    formats : list of str
        Forms of the stamps; two where day and month cannot be told apart, none of times that are typed.
    has_offset : bool
        Whether every stamp is in UTC or has an offset.
    qualities : Counter
        How often each quality was met.
    steps_s : dict of tag to list of (n,) float64
        Times from stamp to stamp; of a wide table under the empty tag. [s]
    tags : dict of tag to Seen
    """

    time: str
    date: str
    tag: str = ""
    value: str = ""
    quality: str = ""
    unit: str = ""
    formats: list[str]
    has_offset: bool = True
    qualities: Counter[str] = field(default_factory=Counter)
    steps_s: dict[str, list[Floats]] = field(default_factory=dict)
    tags: dict[str, Seen] = field(default_factory=dict)

    @property
    def layout(self) -> str:
        """Long or wide."""
        return "long" if self.tag else "wide"


def look(files: Sequence[ExportFile]) -> Look:
    """Look at the files of an export.

    Raises
    ------
    RecordingError
        If a file cannot be read, or no column holds times.
    """
    first = files[0]
    time, date = _time_headers(first, first.ends(first.names))
    texts = stamp_texts(first, time, date or None)
    long = _long_headers(first.names)
    looked = Look(time=time, date=date, formats=find_formats(texts))
    looked.tag, looked.value = long.get("tag", ""), long.get("value", "")
    looked.quality, looked.unit = long.get("quality", ""), long.get("unit", "")
    for file in files:
        for block in islice(file.blocks(file.names, Refusals()), _MOST_BLOCKS):
            _see_block(looked, block, file.decimal)
        for note in file.notes:
            for name, cell in zip(file.names, note, strict=True):
                if name in looked.tags and cell and not looked.tags[name].unit_text:
                    looked.tags[name].unit_text = cell
    return looked


def _long_headers(names: Sequence[str]) -> dict[str, str]:
    """Headers of a long file: tag, value, quality and unit; none of a wide one."""
    headers = {name.strip().lower().lstrip("_"): name for name in names}
    known = {"tag": _TAG_HEADERS, "value": _VALUE_HEADERS, "quality": _QUALITY_HEADERS, "unit": _UNIT_HEADERS}
    found = {key: next((headers[word] for word in words if word in headers), "") for key, words in known.items()}
    return found if found["tag"] and found["value"] else {}


def _see_block(looked: Look, block: Block, decimal: str) -> None:
    form = TimeFormat.of(looked.formats[0]) if looked.formats else None
    stamps = read_stamps(stamp_column(block, looked.time, looked.date or None), form)
    looked.has_offset &= bool(np.all(stamps.is_utc[stamps.is_read]))
    if looked.layout == "wide":
        looked.steps_s.setdefault("", []).append(np.diff(stamps.time_ns[stamps.is_read]) / NS_PER_S)
        for name, column in block.columns.items():
            if name not in {looked.time, looked.date}:
                looked.tags.setdefault(name, Seen()).add(column, decimal)
        return
    if looked.quality:
        looked.qualities.update(_counts(block.columns[looked.quality]))
    for name, rows in _rows_of_tags(block.columns[looked.tag]):
        seen = looked.tags.setdefault(name, Seen())
        seen.add(block.columns[looked.value].take(pa.array(rows)), decimal)
        known = rows[stamps.is_read[rows]]
        looked.steps_s.setdefault(name, []).append(np.diff(stamps.time_ns[known]) / NS_PER_S)
        if looked.unit and not seen.unit_text:
            seen.unit_text = texts_of(block.columns[looked.unit])[int(rows[0])].as_py() or ""


def _time_headers(file: ExportFile, blocks: Sequence[Block]) -> tuple[str, str]:
    """Headers of the times, and of the dates if they stand apart."""
    block = next((block for block in blocks if len(block.lines)), None)
    texts = {name: _some(block.columns[name]) for name in file.names} if block else {}
    stamped = [
        name for name, some in texts.items() if some and sum(map(looks_like_time, some)) >= _LIKELY * len(some)
    ]
    of_day = [n for n, some in texts.items() if some and sum(map(_is_time_of_day, some)) >= _LIKELY * len(some)]
    if stamped and of_day and not any(" " in text.strip() for text in texts[stamped[0]]):
        return of_day[0], stamped[0]
    if stamped:
        return stamped[0], ""
    for name, some in texts.items():
        forms = find_formats(some)
        if forms and (_TIME_HEADER.search(name.lower()) or forms[0].startswith("epoch")):
            return name, ""
    raise RecordingError(f"{file.path}: no column with times was found among {', '.join(map(repr, file.names[:8]))}")


def _is_time_of_day(text: str) -> bool:
    return _TIME_OF_DAY.fullmatch(text.strip()) is not None


def _some(column: pa.Array) -> list[str]:
    return [text for text in texts_of(column[:400]).to_pylist() if text]


def _counts(column: pa.Array) -> dict[str, int]:
    counted = pc.value_counts(pc.fill_null(texts_of(column), ""))
    return {row["values"]: row["counts"] for row in counted.to_pylist()}


def _rows_of_tags(column: pa.Array) -> Iterator[tuple[str, Integers]]:
    encoded = pc.fill_null(texts_of(column), "").dictionary_encode()
    codes = encoded.indices.to_numpy()
    for code, name in enumerate(encoded.dictionary.to_pylist()):
        if name:
            yield name, np.flatnonzero(codes == code)
