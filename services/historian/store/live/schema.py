"""The tables of the live database, and the upgrade of those of an earlier version."""

import contextlib
import logging
import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache
from itertools import groupby
from pathlib import Path

from wetwell.services.historian.store.interface import StoreError
from wetwell.services.historian.store.live.connection import UNREADABLE, connect
from wetwell.services.historian.store.live.end import END_TABLES
from wetwell.services.historian.store.live.tally import TALLY_TABLES

log = logging.getLogger(__name__)

VERSION = 4
"""Two versions never have the same tables, indices and triggers: by these a version that a disk has changed shows."""

_REFUSED = """
CREATE TABLE refused (origin TEXT NOT NULL, key TEXT NOT NULL, content BLOB);
"""
"""What stood in rows that are not what was written; their table and key there."""

_LIVE_TABLES = f"""
BEGIN IMMEDIATE;
CREATE TABLE station (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, first_ns INTEGER, last_ns INTEGER);
CREATE TABLE sample (
    station INTEGER NOT NULL, time_ns INTEGER NOT NULL, seq INTEGER NOT NULL, quality INTEGER NOT NULL,
    data BLOB NOT NULL, size INTEGER NOT NULL DEFAULT 1, last_ns INTEGER, crc INTEGER,
    PRIMARY KEY (station, time_ns, seq)
) WITHOUT ROWID;
CREATE TABLE event (
    id INTEGER PRIMARY KEY, kind TEXT NOT NULL, station INTEGER NOT NULL, time_ns INTEGER NOT NULL,
    digest BLOB NOT NULL, payload BLOB NOT NULL, crc INTEGER, UNIQUE (kind, station, time_ns, digest)
);
CREATE TABLE hour (
    station INTEGER NOT NULL, hour_ns INTEGER NOT NULL, data BLOB NOT NULL, crc INTEGER,
    PRIMARY KEY (station, hour_ns)
) WITHOUT ROWID;
{_REFUSED}
{TALLY_TABLES}
{END_TABLES}
PRAGMA user_version = {VERSION};
COMMIT;
"""
"""A row of `sample` is a `SampleRow`. For one sample `last_ns` is NULL. For several `seq` is a number below 0, which
tells rows from each other that begin at the same time. `crc` is the checksum of the row; those of an earlier version
have none."""

_UPGRADES = {
    1: """
BEGIN IMMEDIATE;
ALTER TABLE sample ADD COLUMN size INTEGER NOT NULL DEFAULT 1;
ALTER TABLE sample ADD COLUMN last_ns INTEGER;
PRAGMA user_version = 2;
COMMIT;
""",
    2: f"""
BEGIN IMMEDIATE;
ALTER TABLE sample ADD COLUMN crc INTEGER;
ALTER TABLE hour ADD COLUMN crc INTEGER;
ALTER TABLE event ADD COLUMN crc INTEGER;
{_REFUSED}
PRAGMA user_version = 3;
COMMIT;
""",
    3: f"""
BEGIN IMMEDIATE;
{TALLY_TABLES}
{END_TABLES}
PRAGMA user_version = 4;
COMMIT;
""",
}
"""Version 1 had rows of one sample, version 2 no checksums of rows, version 3 no tally. No row is written anew: a
large site has some ten gigabytes of them. They are counted once, which takes such a site about a minute."""


def prepare(database: sqlite3.Connection, path: Path, alone: Callable[[], AbstractContextManager[None]]) -> None:
    """Make the tables, or bring those of an earlier version to this one; whole or not at all.

    In the context that `alone` gives no historian works on the file: an earlier one would not know the new table.

    Raises
    ------
    StoreError
        If the file is of a later version, or a historian works on one that must be upgraded.
    sqlite3.DatabaseError
        If a disk has changed its version.
    """
    if damages := version_damages(database):
        raise sqlite3.DatabaseError(damages[0])
    version = _version(database)
    if version > VERSION:
        raise StoreError(f"{path}: version {version} is newer than {VERSION}, which this program knows")
    if version == 0:
        try:
            database.executescript(_LIVE_TABLES)
        except sqlite3.OperationalError:
            database.rollback()
            if _version(database) != VERSION:  # else another has made them meanwhile
                raise
    elif version < VERSION:
        with alone():
            while (version := _version(database)) < VERSION:  # else another has done it meanwhile
                database.executescript(_UPGRADES[version])
                log.info("%s: upgraded from version %d to %d", path, version, version + 1)


def schema_damages(database: sqlite3.Connection) -> list[str]:
    """Say which tables and triggers of a database of this version are not as they were made, or its version.

    SQLite itself takes a word of its schema that a disk has changed for another name.
    """
    made, there = _made(), _parts(database)
    damages = [f"schema: {name} is not as it was made" for name in sorted(made) if there.get(name) != made[name]]
    return damages or version_damages(database)


def mend_schema(path: Path) -> None:
    """Write the text of each table as it was made into a damaged file: by another one no row of it may be found.

    Rows of earlier versions are read by it, too: columns that came later stand behind the others.
    """
    with (
        contextlib.suppress(*UNREADABLE),
        contextlib.closing(_new_database()) as new,
        contextlib.closing(connect(f"{path.absolute().as_uri()}?mode=rw", uri=True)) as damaged,
    ):
        damaged.execute("PRAGMA writable_schema = ON")
        with contextlib.suppress(*UNREADABLE):  # it takes the schema as far as it can, and the next statement works
            damaged.execute("SELECT count(*) FROM sqlite_master").fetchone()
        texts = new.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'")
        damaged.executemany("UPDATE sqlite_master SET sql = ?2 WHERE name = ?1 AND sql IS NOT ?2", texts)
        damaged.commit()


def version_damages(database: sqlite3.Connection) -> list[str]:
    """Say that a disk has changed the version of a database; empty if not.

    Its parts are exactly those of this version, or no program has such a version.
    """
    is_of_this = _parts(database) == _made()
    version = _version(database)  # after the parts: another may have made or upgraded them meanwhile
    is_changed = version < 0 or (is_of_this and version != VERSION)
    return [f"schema: version {version} is not that of its tables"] if is_changed else []


@cache
def _made() -> dict[str, object]:
    with contextlib.closing(_new_database()) as database:
        return _parts(database)


def _new_database() -> sqlite3.Connection:
    database = sqlite3.connect(":memory:", isolation_level=None)
    database.executescript(_LIVE_TABLES)
    return database


def _parts(database: sqlite3.Connection) -> dict[str, object]:
    """Of each table its columns, whose texts differ after an upgrade, and of each other part its text."""
    columns = database.execute(
        'SELECT m.name, c.name, c.type, c."notnull", c.dflt_value, c.pk FROM sqlite_master AS m, '
        "pragma_table_info(m.name) AS c WHERE m.type = 'table' ORDER BY m.name, c.cid"
    ).fetchall()
    tables = {name: [column[1:] for column in of] for name, of in groupby(columns, lambda column: column[0])}
    others = database.execute("SELECT name, sql FROM sqlite_master WHERE type IN ('index', 'trigger', 'view')")
    return tables | dict(others)


def _version(database: sqlite3.Connection) -> int:
    return int(database.execute("PRAGMA user_version").fetchone()[0])
