"""Files of an export read into events by a mapping, block by block."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pyarrow.compute as pc

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.quantities import pump_of
from wetwell.protocols.recordings.importers.mapping import TagMapping, TagSignal
from wetwell.protocols.recordings.importers.refusals import Refusals
from wetwell.protocols.recordings.importers.signals.events import EventStore
from wetwell.protocols.recordings.importers.signals.numbers import Cells, read_cells
from wetwell.protocols.recordings.importers.signals.scaling import plain, signal_values
from wetwell.protocols.recordings.importers.tables.block import Block, ExportFile, texts_of
from wetwell.protocols.recordings.importers.times.stamp_column import stamp_column
from wetwell.protocols.recordings.importers.times.stamps import Stamps, read_stamps
from wetwell.protocols.recordings.importers.times.time_format import TimeFormat


class ExportReader:
    """Reads files of an export, one after the other.

    Attributes
    ----------
    store : EventStore
        What the files say of the signals.
    refusals : Refusals
        What could not be read.
    words : dict
        Meaning of status words that the mapping does not name.
    bad_quality : Counter
        Values of each signal that were left out, as their quality is not good.
    tag_rows : Counter
        Rows of each tag of long files.
    """

    def __init__(self, mapping: TagMapping, form: TimeFormat | None, nominal_hz: Sequence[float]) -> None:
        self._mapping = mapping
        self._form = form
        self._nominal_hz = nominal_hz
        self.store = EventStore()
        self.refusals = Refusals()
        self.words: dict[str, str] = {}
        self.bad_quality: Counter[str] = Counter()
        self.tag_rows: Counter[str] = Counter()

    def read(self, file: ExportFile) -> None:
        """Read a file.

        Raises
        ------
        RecordingError
            If it cannot be read, or lacks a column that the mapping names.
        ValueError
            If a unit of the mapping needs a station file.
        """
        columns = self._mapping.columns
        needed = [columns.time, columns.date, columns.tag, columns.value, columns.quality]
        for header in needed:
            if header is not None and header not in file.names:
                there = ", ".join(map(repr, file.names[:8]))
                raise RecordingError(f"{file.path}: columns: there is no '{header}', there is {there}")
        if self._mapping.layout == "wide":
            needed += [header for signal in self._mapping.signal.values() for header in (signal.tag, signal.quality)]
        for block in file.blocks({header for header in needed if header}, self.refusals):
            stamps = read_stamps(stamp_column(block, columns.time, columns.date), self._form)
            rows = np.flatnonzero(stamps.is_read)
            if rows.size < len(block.lines):
                self._refuse(file, block, ~stamps.is_read)
            if self._mapping.layout == "long":
                self._add_long(file, block, stamps, rows)
            else:
                self._add_wide(file, block, stamps, rows)

    def _refuse(self, file: ExportFile, block: Block, is_unread: Flags) -> None:
        """Count rows without a stamp, but not those that are empty throughout."""
        is_blank = np.ones(len(block.lines), dtype=bool)
        for cells in block.columns.values():
            is_blank &= pc.fill_null(pc.equal(texts_of(cells), ""), True).to_numpy(zero_copy_only=False)
        places = np.flatnonzero(is_unread & ~is_blank)
        if places.size:
            columns = self._mapping.columns
            first = texts_of(stamp_column(block, columns.time, columns.date))[int(places[0])].as_py() or ""
            why = f"time is not {self._form.name}" if self._form else "no time"
            self.refusals.add(why, file.path, block.lines[places], first)

    def _add_long(self, file: ExportFile, block: Block, stamps: Stamps, rows: Integers) -> None:
        columns = self._mapping.columns
        encoded = pc.fill_null(texts_of(block.columns[columns.tag or ""]), "").dictionary_encode()
        tags, codes = encoded.dictionary.to_pylist(), encoded.indices.to_numpy()
        self.tag_rows.update(dict(zip(tags, np.bincount(codes, minlength=len(tags)).tolist(), strict=True)))
        cells = read_cells(block.columns[columns.value or ""], file.decimal)
        is_good = self._is_good(block, columns.quality)
        for code, tag in enumerate(tags):
            signals = {name: signal for name, signal in self._mapping.signal.items() if signal.tag == tag}
            mine = rows[codes[rows] == code] if signals else rows
            values = {
                name: (
                    self._values(file, block, name, signal, cells.take(mine), is_good, mine),
                    np.ones(mine.size, dtype=bool),
                )
                for name, signal in signals.items()
            }
            if values:
                self.store.add(tag, file.path, block.lines[mine], stamps.take(mine), values)

    def _add_wide(self, file: ExportFile, block: Block, stamps: Stamps, rows: Integers) -> None:
        is_whole = rows.size == len(block.lines)
        values: dict[str, tuple[Floats, Flags]] = {}
        for name, signal in self._mapping.signal.items():
            if signal.tag in block.columns:
                cells = read_cells(block.columns[signal.tag], file.decimal)
                cells = cells if is_whole else cells.take(rows)
                is_good = self._is_good(block, signal.quality)
                values[name] = (self._values(file, block, name, signal, cells, is_good, rows), ~cells.is_empty)
        self.store.add(file.names, file.path, block.lines[rows], stamps if is_whole else stamps.take(rows), values)

    def _is_good(self, block: Block, header: str | None) -> Flags | None:
        """Whether the quality of each row is good; None if there is no quality."""
        if header is None or header not in block.columns:
            return None
        encoded = pc.fill_null(texts_of(block.columns[header]), "").dictionary_encode()
        good = {plain(word) for word in self._mapping.columns.good}
        is_good = np.array([plain(word) in good for word in encoded.dictionary.to_pylist()], dtype=bool)
        return np.asarray(is_good[encoded.indices.to_numpy()])

    def _values(
        self,
        file: ExportFile,
        block: Block,
        name: str,
        signal: TagSignal,
        cells: Cells,
        is_good: Flags | None,
        rows: Integers,
    ) -> Floats:
        """Values of a signal in some rows of a block; words go to the refusals, values of bad quality are none."""
        number = pump_of(name)
        nominal_hz = self._nominal_hz[number - 1] if 0 < number <= len(self._nominal_hz) else None
        read = signal_values(name, signal, cells, nominal_hz)
        self.words.update({f"{name} {word!r}": meaning for word, meaning in read.assumed.items()})
        unread = np.flatnonzero(read.is_unread)
        if unread.size:
            first = texts_of(cells.column)[int(unread[0])].as_py()
            self.refusals.add(f"'{signal.tag}' is no number", file.path, block.lines[rows[unread]], first)
        if is_good is None:
            return read.values
        is_bad = ~is_good[rows] & ~cells.is_empty
        self.bad_quality[name] += int(is_bad.sum())
        return np.where(is_bad, np.nan, read.values)
