"""What can still be read of a live database that is damaged, and whether one is."""

import contextlib
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.store.live.connection import UNREADABLE, broken_trees, connect
from wetwell.services.historian.store.live.end import lost_of
from wetwell.services.historian.store.live.row_checksum import (
    is_event_intact,
    is_hour_intact,
    is_sample_intact,
    last_ns_of,
)
from wetwell.services.historian.store.live.schema import schema_damages, version_damages
from wetwell.services.historian.store.live.station_names import station_rows
from wetwell.services.historian.store.live.tally import miscounts

Row = tuple[Any, ...]

_SAMPLE = "station, time_ns, seq, quality, data, size, last_ns, crc"
_COLUMNS = {
    "station": "id, name, first_ns, last_ns",
    "sample": _SAMPLE,
    "event": "id, kind, station, time_ns, digest, payload, crc",
    "hour": "station, hour_ns, data, crc",
}
"""In the order in which every version since the third one has them."""
CHECKED_VERSION = 3
"""The first one whose rows have checksums."""
COUNTED_VERSION = 4
"""The first one that knows how many rows it has."""
MOST_SKIPPED = 10_000
"""Hundreds of messages that are looked for before the last one."""
MOST_DAMAGES = 100
"""Damages of trees and pages that are told of a file."""
MOST_TRIED = 20_000
"""Spans of a station, or of a hundred messages, that are read by themselves where some rows cannot be read."""
_SPAN_OF_SAMPLES = """
UPDATE station SET first_ns = (SELECT min(time_ns) FROM sample WHERE station = id),
    last_ns = (SELECT max(coalesce(last_ns, time_ns)) FROM sample WHERE station = id) WHERE first_ns IS NULL
"""
"""Times of stations of which only the name could be read."""


def damage_of(path: Path) -> list[str]:
    """What is wrong in a live database, and what in it is not what was written; nothing is changed."""
    told: list[str] = []
    counts: dict[str, int] = {}
    try:
        with _reading(path) as database:
            told += broken_trees(database, MOST_DAMAGES)
            version = int(database.execute("PRAGMA user_version").fetchone()[0])
            told += schema_damages(database) if version >= COUNTED_VERSION else version_damages(database)
            crc = "crc" if version >= CHECKED_VERSION else "NULL"
            messages = database.execute(f"SELECT kind, station, time_ns, digest, payload, {crc} FROM event")  # noqa: S608
            counts["messages"] = sum(not is_event_intact(*row) for row in messages)
            if version >= CHECKED_VERSION:
                samples = database.execute(f"SELECT {_SAMPLE} FROM sample")  # noqa: S608 - names of above
                counts["rows of samples"] = sum(_sample(row) != row for row in samples)
                hours = database.execute("SELECT station, hour_ns, data, crc FROM hour")
                counts["hours"] = sum(not is_hour_intact(*row) for row in hours)
            if version >= COUNTED_VERSION:
                told += map(str, miscounts(database))
                lost = lost_of(path, database)
                told += [] if lost is None else [lost]
    except (sqlite3.Error, UnicodeDecodeError) as error:
        told.append(str(error))
    return [*told, *(f"{count} {what} are not what was written" for what, count in counts.items() if count)]


def salvage(damaged: Path, target: sqlite3.Connection) -> tuple[int, int]:
    """Take the rows that can be read, and are what was written, into a new database.

    Returns
    -------
    saved, lost : int
        Rows that were taken, and rows that were read but are not what was written.

    Raises
    ------
    sqlite3.Error
        If the new database cannot be written.
    """
    saved, lost = 0, set[Row]()
    target.execute("BEGIN IMMEDIATE")
    try:
        with _reading_what_it_can(damaged) as database:
            for insert, rows, taken in _tables(database):
                for row in rows:
                    if (its := taken(row)) is None:
                        lost.add((insert, *row[:3]))
                        continue
                    with contextlib.suppress(sqlite3.IntegrityError, sqlite3.InterfaceError):
                        saved += target.execute(insert, its).rowcount
            target.execute(_SPAN_OF_SAMPLES)
    except UNREADABLE:
        target.execute("ROLLBACK")
        return 0, 0
    target.execute("COMMIT")
    return saved, len(lost)


def _tables(database: sqlite3.Connection) -> Iterator[tuple[str, Iterator[Row], Callable[[Row], Row | None]]]:
    """Of each table how a row is inserted, its rows as far as they can be read, and what is taken of one."""
    stations = station_rows(database)
    yield "INSERT OR IGNORE INTO station VALUES (?, ?, ?, ?)", iter(stations), lambda row: row
    numbers = {row[0] for row in stations}
    samples = _all_samples(database, numbers)
    yield "INSERT OR IGNORE INTO sample VALUES (?, ?, ?, ?, ?, ?, ?, ?)", samples, _sample
    yield (
        "INSERT OR IGNORE INTO event (kind, station, time_ns, digest, payload, crc) VALUES (?, ?, ?, ?, ?, ?)",
        _events(database),
        lambda row: row if is_event_intact(*row) and row[1] in numbers else None,
    )
    hours = _readable(database, "SELECT station, hour_ns, data, crc FROM hour")
    yield (
        "INSERT OR IGNORE INTO hour VALUES (?, ?, ?, ?)",
        iter(hours),
        lambda row: row if is_hour_intact(*row) else None,
    )


def _all_samples(database: sqlite3.Connection, stations: Iterable[int]) -> Iterator[Row]:
    """Rows of each station; then all, where there are others: one whose station was changed ends those of its own.

    Of one that is of no station nothing else is read: what cannot be read of it would end all.
    """
    count, known = 0, tuple(stations)
    for station in known:
        for row in _samples(database, station):
            count += 1
            yield row
    if _readable(database, "SELECT count(*) FROM sample") != [(count,)]:
        for order in ("", "DESC"):
            of_known = f"WHERE +station IN ({', '.join('?' * len(known))})"  # the sign keeps SQLite from its index
            query = f"SELECT {_SAMPLE} FROM sample {of_known} ORDER BY station {order}, time_ns {order}, seq {order}"  # noqa: S608
            yield from _as_far_as_can_be(database, query, known)


def _samples(database: sqlite3.Connection, station: int) -> Iterator[Row]:
    """Rows of a station from both ends, and what lies between them in parts."""
    query = f"SELECT {_SAMPLE} FROM sample WHERE station = ? ORDER BY time_ns"  # noqa: S608 - names of above
    first, is_whole = _read(database, query, (station,))
    yield from first
    if is_whole:
        return
    last, _ = _read(database, f"{query} DESC", (station,))
    yield from last
    begin_ns, end_ns = (next((row[1] for row in reversed(rows) if _sample(row)), None) for rows in (first, last))
    if begin_ns is not None and end_ns is not None:
        between = f"SELECT {_SAMPLE} FROM sample WHERE station = ? AND time_ns >= ? AND time_ns < ? ORDER BY time_ns"  # noqa: S608
        yield from _in_parts(database, between, (station,), (begin_ns, end_ns), NS_PER_S)


def _events(database: sqlite3.Connection) -> Iterator[Row]:
    """Messages, a hundred after the other."""
    ends = _readable(database, "SELECT max(id) FROM event")
    most = ends[0][0] if ends and isinstance(ends[0][0], int) else 0
    query = "SELECT kind, station, time_ns, digest, payload, crc FROM event WHERE id > ? AND id <= ? ORDER BY id"
    for begin in range(max(0, most - 100 * MOST_SKIPPED), most + 1, 100):
        yield from _in_parts(database, query, (), (begin, begin + 100), 1)


def _in_parts(
    database: sqlite3.Connection, query: str, values: Row, span: tuple[int, int], shortest: int
) -> Iterator[Row]:
    """Rows of a span of numbers, some of them twice: where one cannot be read, from both ends, and of each half.

    Parameters
    ----------
    database : sqlite3.Connection
    query : str
        In order of the number; its last two values are the span.
    values : tuple
        The others.
    span : (int, int)
    shortest : int
        A span that is not halved any more.
    """
    left = [span]
    for _ in range(MOST_TRIED):
        if not left:
            return
        begin, end = left.pop()
        rows, is_whole = _read(database, query, (*values, begin, end))
        yield from rows
        if is_whole:
            continue
        yield from _readable(database, f"{query} DESC", (*values, begin, end))
        if end - begin > shortest:
            middle = (begin + end) // 2
            left += [(middle, end), (begin, middle)]


def _readable(database: sqlite3.Connection, query: str, values: Row = ()) -> list[Row]:
    """Rows until one cannot be read."""
    return _read(database, query, values)[0]


def _read(database: sqlite3.Connection, query: str, values: Row) -> tuple[list[Row], bool]:
    """Rows until one cannot be read, and whether these are all."""
    rows: list[Row] = []
    try:
        rows.extend(database.execute(query, values))
    except UNREADABLE:
        return [*rows, *_next_row(database, query, values, len(rows))], False
    return rows, True


def _as_far_as_can_be(database: sqlite3.Connection, query: str, values: Row) -> Iterator[Row]:
    """Rows until one cannot be read, one after the other: they may be many."""
    count = 0
    try:
        for row in database.execute(query, values):
            count += 1
            yield row
    except UNREADABLE:
        yield from _next_row(database, query, values, count)


def _next_row(database: sqlite3.Connection, query: str, values: Row, count: int) -> list[Row]:
    """The row behind so many: Python looks a row ahead, and gives none before one that cannot be read."""
    with contextlib.suppress(*UNREADABLE):
        return database.execute(f"{query} LIMIT 1 OFFSET {count}", values).fetchall()
    return []


def _sample(row: Row) -> Row | None:
    """A row of samples, with the time of the last one by their data; None if it is not what was written."""
    station, time_ns, seq, quality, data, size, last_ns, crc = row
    if not is_sample_intact(station, time_ns, seq, quality, size, data, last_ns, crc):
        return None
    return station, time_ns, seq, quality, data, size, last_ns_of(size, data), crc


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[sqlite3.Connection]:
    with contextlib.closing(connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
        yield database


@contextlib.contextmanager
def _reading_what_it_can(path: Path) -> Iterator[sqlite3.Connection]:
    """Go on with what SQLite understands of a schema whose text a disk has changed; columns are known by places."""
    with _reading(path) as database:
        database.execute("PRAGMA writable_schema = ON")
        with contextlib.suppress(*UNREADABLE):  # it takes the schema as far as it can, and the next statement works
            database.execute("SELECT count(*) FROM sqlite_master").fetchone()
        for table, columns in _COLUMNS.items():
            database.execute(f"CREATE TEMP VIEW {table} ({columns}) AS SELECT * FROM main.{table}")  # noqa: S608 - names of above
        yield database
