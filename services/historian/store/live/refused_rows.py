"""Rows of a live database that are not what was written: told once, and put aside by the next writing."""

import logging
import sqlite3
import threading
from pathlib import Path
from typing import Literal

from wetwell.services.historian.store.live.connection import of_key

log = logging.getLogger(__name__)

Table = Literal["sample", "event", "hour"]

_ROW_OF: dict[Table, str] = {
    "sample": of_key("station", "time_ns", "seq"),
    "event": of_key("id"),
    "hour": of_key("station", "hour_ns"),
}
_CONTENT: dict[Table, str] = {"sample": "data", "event": "payload", "hour": "data"}


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
        self._found: dict[tuple[Table, tuple[int, ...]], None] = {}
        self._not_there: set[tuple[Table, tuple[int, ...]]] = set()

    def note(self, table: Table, *key: int) -> None:
        """Know a row by the key of its table, and tell it."""
        with self._lock:
            is_new = (table, key) not in self._found
            self._found[table, key] = None
        if is_new:
            log.error("%s: a row of table %s is not what was written, and left out", self._path, table)

    def put_aside(self, database: sqlite3.Connection) -> tuple[int, bool]:
        """Move what was found into the table of refused rows, in a transaction of the caller.

        Returns
        -------
        count, is_damaged : int, bool
            How many rows; and whether one is read again and again that is not where its key says: then the order of
            the file is damaged.
        """
        with self._lock:
            found, self._found = self._found, {}
        count, is_damaged = 0, False
        for table, key in found:
            row, content = f"FROM {table} WHERE {_ROW_OF[table]}", _CONTENT[table]
            put_aside = f"INSERT INTO refused SELECT '{table}', ?{len(key) + 1}, {content} {row}"
            database.execute(put_aside, (*key, str(key)))
            deleted = database.execute(f"DELETE {row}", key).rowcount
            count += deleted
            if not deleted:
                is_damaged = is_damaged or (table, key) in self._not_there
                self._not_there.add((table, key))
        return count, is_damaged
