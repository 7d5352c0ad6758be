"""The tables of the live database, and the upgrade of those of an earlier version."""

import logging
import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from wetwell.services.historian.store import StoreError

log = logging.getLogger(__name__)

VERSION = 2

_SAMPLE = """
CREATE TABLE sample (
    station INTEGER NOT NULL, time_ns INTEGER NOT NULL, seq INTEGER NOT NULL, size INTEGER NOT NULL,
    digest INTEGER NOT NULL, last_ns INTEGER NOT NULL, quality INTEGER NOT NULL, data BLOB NOT NULL,
    PRIMARY KEY (station, time_ns, seq, size, digest)
) WITHOUT ROWID;
"""
"""Rows as `SampleRow`; `digest` tells rows that begin alike from each other."""

_SCHEMA = f"""
BEGIN IMMEDIATE;
CREATE TABLE station (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, first_ns INTEGER, last_ns INTEGER);
{_SAMPLE}
CREATE TABLE event (
    id INTEGER PRIMARY KEY, kind TEXT NOT NULL, station INTEGER NOT NULL, time_ns INTEGER NOT NULL,
    digest BLOB NOT NULL, payload BLOB NOT NULL, UNIQUE (kind, station, time_ns, digest)
);
CREATE TABLE hour (
    station INTEGER NOT NULL, hour_ns INTEGER NOT NULL, data BLOB NOT NULL, PRIMARY KEY (station, hour_ns)
) WITHOUT ROWID;
PRAGMA user_version = {VERSION};
COMMIT;
"""

_FROM_VERSION_1 = f"""
BEGIN IMMEDIATE;
ALTER TABLE sample RENAME TO sample_1;
{_SAMPLE}
INSERT INTO sample SELECT station, time_ns, seq, 1, 0, time_ns, quality, data FROM sample_1;
DROP TABLE sample_1;
PRAGMA user_version = 2;
COMMIT;
"""  # noqa: S608 - a constant
"""Version 1 had rows of one sample."""


def prepare(database: sqlite3.Connection, path: Path, alone: Callable[[], AbstractContextManager[None]]) -> None:
    """Make the tables, or bring those of an earlier version to this one; whole or not at all.

    In the context that `alone` gives no historian works on the file: an earlier one would not know the new table.

    Raises
    ------
    StoreError
        If the file is of a later version, or a historian works on one that must be upgraded.
    """
    version = _version(database)
    if version > VERSION:
        raise StoreError(f"{path}: version {version} is newer than {VERSION}, which this program knows")
    if version == 0:
        database.executescript(_SCHEMA)
    elif version == 1:
        with alone():
            if _version(database) == 1:  # else another has done it meanwhile
                log.warning("%s: is upgraded from version 1, which may take minutes", path)
                database.executescript(_FROM_VERSION_1)


def _version(database: sqlite3.Connection) -> int:
    return int(database.execute("PRAGMA user_version").fetchone()[0])
