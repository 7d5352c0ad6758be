"""What an export says of each signal: events, each with its stamp, in the order of the files."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.local_time import to_utc
from wetwell.protocols.recordings.importers.refusals import Refusals
from wetwell.protocols.recordings.importers.times.stamps import Stamps
from wetwell.protocols.timestamps import to_iso


@dataclass(frozen=True, slots=True, kw_only=True)
class Events:
    """Rows of one tag, or of one wide table, in the order of their time.

    Attributes
    ----------
    time_ns : (n,) int64
        [ns]
    values : mapping of signal to (n,) float64
        NaN is "no value".
    is_event : mapping of signal to (n,) bool
        Whether the row says anything of the signal: an empty cell of a wide table does not.
    """

    time_ns: Integers
    values: Mapping[str, Floats]
    is_event: Mapping[str, Flags]


@dataclass(slots=True, kw_only=True)
class _Rows:
    """Rows of one tag, or of one wide table, as they come."""

    paths: list[Path] = field(default_factory=list)
    lines: list[Integers] = field(default_factory=list)
    stamps: list[Stamps] = field(default_factory=list)
    values: dict[str, list[Floats]] = field(default_factory=dict)
    is_event: dict[str, list[Flags]] = field(default_factory=dict)


class EventStore:
    """Events of all tags, gathered from blocks of rows."""

    def __init__(self) -> None:
        self._rows: dict[object, _Rows] = {}

    def add(
        self,
        key: object,
        path: Path,
        lines: Integers,
        stamps: Stamps,
        values: Mapping[str, tuple[Floats, Flags]],
    ) -> None:
        """Add rows of a tag, or of a wide table: `values` are those of each signal, and whether they are events."""
        rows = self._rows.setdefault(key, _Rows())
        rows.paths.append(path)
        rows.lines.append(lines.astype(np.int32))
        rows.stamps.append(stamps)
        for name, (numbers, is_event) in values.items():
            rows.values.setdefault(name, []).append(numbers)
            rows.is_event.setdefault(name, []).append(is_event)

    def events(self, zone: ZoneInfo | None, refusals: Refusals) -> tuple[list[Events], int]:
        """Events in UTC, and how many stamps of a doubled hour could not be decided.

        Stamps in an hour that the clocks left out go to `refusals`.

        Raises
        ------
        ValueError
            If a stamp has no offset and there is no zone.
        """
        done = [self._finished(rows, zone, refusals) for rows in self._rows.values()]
        self._rows.clear()
        return [events for events, _ in done], sum(undecided for _, undecided in done)

    def _finished(self, rows: _Rows, zone: ZoneInfo | None, refusals: Refusals) -> tuple[Events, int]:
        time_ns = np.concatenate([stamps.time_ns for stamps in rows.stamps])
        is_local = ~np.concatenate([stamps.is_utc for stamps in rows.stamps])
        is_kept = np.ones(time_ns.size, dtype=bool)
        undecided = 0
        if is_local.any():
            if zone is None:
                place = _place(rows, int(np.argmax(is_local)))
                raise ValueError(f"time_zone: missing, the stamp of {place} has no offset")
            local_ns = time_ns[is_local]
            utc = to_utc(local_ns, zone)
            time_ns[is_local] = utc.time_ns
            is_kept[np.flatnonzero(is_local)[utc.is_missing]] = False
            undecided = utc.undecided
            _refuse(rows, np.flatnonzero(is_local)[utc.is_missing], local_ns[utc.is_missing], refusals)
        order = np.flatnonzero(is_kept)
        if np.any(np.diff(time_ns[order]) < 0):
            order = order[np.argsort(time_ns[order], kind="stable")]
        values = {name: np.concatenate(parts)[order] for name, parts in rows.values.items()}
        is_event = {name: np.concatenate(parts)[order] for name, parts in rows.is_event.items()}
        return Events(time_ns=time_ns[order], values=values, is_event=is_event), undecided


def _place(rows: _Rows, number: int) -> str:
    for path, lines in zip(rows.paths, rows.lines, strict=True):
        if number < lines.size:
            return f"{path}, line {lines[number]},"
        number -= lines.size
    raise IndexError(number)


def _refuse(rows: _Rows, places: Integers, local_ns: Integers, refusals: Refusals) -> None:
    """Tell the stamps in a missing hour, file by file."""
    for path, lines, begin in _pieces(rows):
        inside = (places >= begin) & (places < begin + lines.size)
        if inside.any():
            first = to_iso(int(local_ns[inside][0])).removesuffix("Z")
            refusals.add("stamp in an hour that the clocks left out", path, lines[places[inside] - begin], first)


def _pieces(rows: _Rows) -> Iterator[tuple[Path, Integers, int]]:
    begin = 0
    for path, lines in zip(rows.paths, rows.lines, strict=True):
        yield path, lines, begin
        begin += lines.size
