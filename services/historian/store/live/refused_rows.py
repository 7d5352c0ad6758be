"""Rows of a live database that are not what was written: told once, and put aside by the next writing."""

import logging
import sqlite3
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

from wetwell.services.historian.store.live.connection import of_key
from wetwell.services.historian.store.live.row_checksum import is_event_intact, is_hour_intact, is_sample_intact

log = logging.getLogger(__name__)

Table = Literal["sample", "event", "hour"]
Row = tuple[Table, tuple[int, ...]]
"""Table and key of a row."""

_ROW_OF: dict[Table, str] = {
    "sample": of_key("station", "time_ns", "seq"),
    "event": of_key("id"),
    "hour": of_key("station", "hour_ns"),
}
_CONTENT: dict[Table, str] = {"sample": "data", "event": "payload", "hour": "data"}
_CHECK: dict[Table, tuple[str, Callable[..., bool]]] = {
    "sample": ("station, time_ns, seq, quality, size, data, last_ns, crc", is_sample_intact),
    "event": ("id, kind, station, time_ns, digest, payload, crc", lambda _, *row: is_event_intact(*row)),
    "hour": ("station, hour_ns, data, crc", is_hour_intact),
}
"""All columns of a row, and what says of them whether they are what was written."""


class PutAside(NamedTuple):
    """What one transaction moves: the rows that were found, how many of them are there, and which are not."""

    rows: frozenset[Row]
    number: int
    not_there: frozenset[Row]


class RefusedRows:
    """Rows that were found damaged. As long as one is in its table, what comes again could not take its place.

    Parameters
    ----------
    path : Path
        Of the database, for the log.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._found: dict[Row, None] = {}
        self._not_there: set[Row] = set()

    @property
    def are_any(self) -> bool:
        """Whether a row waits to be put aside."""
        return bool(self._found)

    def note(self, table: Table, *key: int) -> None:
        """Know a row by the key of its table, and tell it."""
        with self._lock:
            is_new = (table, key) not in self._found
            self._found[table, key] = None
        if is_new:
            log.error("%s: a row of table %s is not what was written, and left out", self._path, table)

    def put_aside(self, database: sqlite3.Connection) -> PutAside:
        """Move what was found into the table of refused rows, in a transaction of the caller.

        A row that has its key and is what was written is another one, such as that of a file begun anew, or what the
        writer remembers of a page that the disk has changed: it is written once more, and counts. Where the disk has
        changed one row it may have changed others, which nobody has read yet.
        """
        with self._lock:
            found = list(self._found)
        count, not_there = 0, set[Row]()
        for table, key in found:
            there, intact = _put_aside(database, table, key)
            count += there
            if there == intact:
                not_there.add((table, key))
        return PutAside(frozenset(found), count, frozenset(not_there))

    def forget(self, aside: PutAside) -> bool:
        """Wait no longer with what was put aside, once its transaction is kept.

        Returns
        -------
        bool
            Whether a row is read again and again that is not found by its key: then the order of the file is damaged.
        """
        with self._lock:
            for row in aside.rows:
                self._found.pop(row, None)
            is_out_of_order = not self._not_there.isdisjoint(aside.not_there)
            self._not_there |= aside.not_there
        return is_out_of_order


def _put_aside(database: sqlite3.Connection, table: Table, key: tuple[int, ...]) -> tuple[int, int]:
    """Move the row of a key, or write it once more if it is what was written; how many have it, and are that."""
    row, content = f"FROM {table} WHERE {_ROW_OF[table]}", _CONTENT[table]
    columns, is_intact = _CHECK[table]
    found = database.execute(f"SELECT {columns} {row}", key).fetchall()
    intact = [its for its in found if is_intact(*its)]
    if not intact:
        put_aside = f"INSERT INTO refused SELECT '{table}', ?{len(key) + 1}, {content} {row}"
        database.execute(put_aside, (*key, str(key)))
    database.execute(f"DELETE {row}", key)
    places = ", ".join("?" * len(columns.split(", ")))
    database.executemany(f"REPLACE INTO {table} ({columns}) VALUES ({places})", intact)  # noqa: S608 - names of above
    return len(found), len(intact)
