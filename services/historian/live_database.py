"""The SQLite database of the live days, of verdicts, alarms and figures.

A write-ahead log with `synchronous=FULL`: when `write` returns, the batch is on the disk and survives `kill -9` and
a power failure. One connection writes; each reading has a connection of its own and sees one moment.
"""

import contextlib
import hashlib
import logging
import operator
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from wetwell.protocols.recording import PUMP_QUANTITIES, STATION_COLUMNS
from wetwell.services.historian.hours import Hours
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store import DAY_NS, Batch, EventKind, StationSpan, StoreError, day_of, span_of

log = logging.getLogger(__name__)

VERSION = 1
BUSY_S = 10.0
"""So long one process waits for another that writes."""

_BY_KEY = operator.itemgetter(0, 1, 2)
"""Station, time, `seq` of a `SampleRow`: inserting in this order takes half the time."""

_SCHEMA = f"""
CREATE TABLE station (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, first_ns INTEGER, last_ns INTEGER);
CREATE TABLE sample (
    station INTEGER NOT NULL, time_ns INTEGER NOT NULL, seq INTEGER NOT NULL, quality INTEGER NOT NULL,
    data BLOB NOT NULL, PRIMARY KEY (station, time_ns, seq)
) WITHOUT ROWID;
CREATE TABLE event (
    id INTEGER PRIMARY KEY, kind TEXT NOT NULL, station INTEGER NOT NULL, time_ns INTEGER NOT NULL,
    digest BLOB NOT NULL, payload BLOB NOT NULL, UNIQUE (kind, station, time_ns, digest)
);
CREATE TABLE hour (
    station INTEGER NOT NULL, hour_ns INTEGER NOT NULL, data BLOB NOT NULL, PRIMARY KEY (station, hour_ns)
) WITHOUT ROWID;
PRAGMA user_version = {VERSION};
"""


class LiveDatabase:
    """A file of SQLite, made if it is not there.

    Raises
    ------
    StoreError
        Here and from every method, if the file cannot be used now. A file that is damaged is put aside, and told.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._ids: dict[str, int] = {}
        try:
            self._writer = self._open()
        except sqlite3.OperationalError as error:
            raise StoreError(f"{path}: {error}") from error
        except sqlite3.DatabaseError as error:
            aside = _put_aside(path)
            log.warning("%s: %s; kept as %s, a new one is begun", path, error, aside.name)
            self._writer = self._open()

    def close(self) -> None:
        """Close it; twice is fine."""
        with self._lock:
            self._writer.close()

    def write(self, batch: Batch) -> int:
        """Keep a batch whole or not at all, and return how many of its rows were new."""
        with self._transaction() as database:
            ids = self._stations(database, batch)
            before = database.total_changes
            database.executemany(
                "INSERT OR IGNORE INTO sample VALUES (?, ?, ?, ?, ?)",
                [
                    (ids[row.station], row.time_ns, row.seq, row.quality, row.data)
                    for row in sorted(batch.samples, key=_BY_KEY)  # rows of a page together
                ],
            )
            database.executemany(
                "INSERT OR IGNORE INTO event (kind, station, time_ns, digest, payload) VALUES (?, ?, ?, ?, ?)",
                [
                    (row.kind, ids[row.station], row.time_ns, _digest(row.payload), row.payload)
                    for row in batch.events
                ],
            )
            new = database.total_changes - before
            database.executemany(
                "UPDATE station SET first_ns = min(coalesce(first_ns, ?1), ?1), "
                "last_ns = max(coalesce(last_ns, ?2), ?2) WHERE id = ?3",
                [(*span, ids[station]) for station, span in span_of(batch.samples).items()],
            )
        self._ids |= ids
        return new

    def adopt(self, spans: Sequence[StationSpan]) -> None:
        """Take stations into the list that are not in it, or of which older or newer samples are kept elsewhere."""
        with self._transaction() as database:
            database.executemany(
                "INSERT INTO station (name, first_ns, last_ns) VALUES (?, ?, ?) ON CONFLICT (name) DO UPDATE SET "
                "first_ns = min(coalesce(first_ns, excluded.first_ns), excluded.first_ns), "
                "last_ns = max(coalesce(last_ns, excluded.last_ns), excluded.last_ns)",
                spans,
            )

    def stations(self) -> list[StationSpan]:
        """All stations, by name."""
        with self._reading() as database:
            rows = database.execute(
                "SELECT name, coalesce(first_ns, 0), coalesce(last_ns, -1) FROM station ORDER BY 1"
            )
            return [StationSpan(*row) for row in rows]

    def samples(self, station: str, start_ns: int, end_ns: int) -> Samples:
        """Samples from `start_ns` until before `end_ns`."""
        with self._reading() as database:
            return Samples.of_rows(
                database.execute(
                    "SELECT time_ns, seq, quality, data FROM sample WHERE station = (SELECT id FROM station "
                    "WHERE name = ?) AND time_ns >= ? AND time_ns < ?",
                    (station, start_ns, end_ns),
                ).fetchall()
            )

    def pumps(self, station: str, start_ns: int, end_ns: int) -> int | None:
        """Number of pumps that the samples of a span speak of; None if there are none."""
        with self._reading() as database:
            (size,) = database.execute(
                "SELECT max(length(data)) FROM sample WHERE station = (SELECT id FROM station WHERE name = ?) "
                "AND time_ns >= ? AND time_ns < ?",
                (station, start_ns, end_ns),
            ).fetchone()
        return None if size is None else (int(size) // 8 - len(STATION_COLUMNS)) // len(PUMP_QUANTITIES)

    def next_time_ns(self, station: str, start_ns: int) -> int | None:
        """Time of the first sample from `start_ns` on."""
        with self._reading() as database:
            (time_ns,) = database.execute(
                "SELECT min(time_ns) FROM sample WHERE station = (SELECT id FROM station WHERE name = ?) "
                "AND time_ns >= ?",
                (station, start_ns),
            ).fetchone()
        return None if time_ns is None else int(time_ns)

    def days_ns(self, station: str, start_ns: int, end_ns: int) -> list[int]:
        """Beginnings of the days that have samples in a span, in order."""
        days_ns = []
        next_ns = self.next_time_ns(station, start_ns)
        while next_ns is not None and next_ns < end_ns:
            days_ns.append(day_of(next_ns))
            next_ns = self.next_time_ns(station, days_ns[-1] + DAY_NS)
        return days_ns

    def count(self, station: str, start_ns: int, end_ns: int, most: int) -> int:
        """Number of samples of a span, counted up to `most`."""
        with self._reading() as database:
            (count,) = database.execute(
                "SELECT count(*) FROM (SELECT 1 FROM sample WHERE station = (SELECT id FROM station WHERE name = ?) "
                "AND time_ns >= ? AND time_ns < ? LIMIT ?)",
                (station, start_ns, end_ns, most),
            ).fetchone()
        return int(count)

    def delete_samples(self, station: str, samples: Samples) -> None:
        """Delete these samples, and no others that came meanwhile."""
        keys = list(zip(samples.time_ns.tolist(), samples.seq.tolist(), strict=True))
        with self._transaction() as database:
            (number,) = database.execute("SELECT id FROM station WHERE name = ?", (station,)).fetchone()
            span = (number, keys[0][0], keys[-1][0])
            between = "FROM sample WHERE station = ? AND time_ns BETWEEN ? AND ?"
            (count,) = database.execute(f"SELECT count(*) {between}", span).fetchone()
            if count == len(keys):
                database.execute(f"DELETE {between}", span)
            else:
                database.executemany(
                    "DELETE FROM sample WHERE station = ? AND time_ns = ? AND seq = ?",
                    [(number, *key) for key in keys],
                )

    def events(self, kind: EventKind, station: str, start_ns: int, end_ns: int, last: int) -> list[bytes]:
        """The last so many verdicts or alarms, oldest first."""
        with self._reading() as database:
            rows = database.execute(
                "SELECT payload FROM event WHERE kind = ? AND station = (SELECT id FROM station WHERE name = ?) "
                "AND time_ns >= ? AND time_ns < ? ORDER BY time_ns DESC, id DESC LIMIT ?",
                (kind, station, start_ns, end_ns, last),
            ).fetchall()
        return [payload for (payload,) in reversed(rows)]

    def delete_events(self, station: str, end_ns: int) -> int:
        """Delete verdicts and alarms from before `end_ns`; returns how many."""
        with self._transaction() as database:
            return database.execute(
                "DELETE FROM event WHERE station = (SELECT id FROM station WHERE name = ?) AND time_ns < ?",
                (station, end_ns),
            ).rowcount

    def hours(self, station: str, start_ns: int, end_ns: int) -> Hours:
        """Figures that `write_hours` has kept."""
        with self._reading() as database:
            return Hours.of_rows(
                database.execute(
                    "SELECT hour_ns, data FROM hour WHERE station = (SELECT id FROM station WHERE name = ?) "
                    "AND hour_ns >= ? AND hour_ns < ? ORDER BY 1",
                    (station, start_ns, end_ns),
                ).fetchall()
            )

    def write_hours(self, station: str, hours: Hours) -> None:
        """Keep figures of hours, in place of earlier ones."""
        with self._transaction() as database:
            (number,) = database.execute("SELECT id FROM station WHERE name = ?", (station,)).fetchone()
            database.executemany("REPLACE INTO hour VALUES (?, ?, ?)", [(number, *row) for row in hours.rows()])

    def size_bytes(self) -> int:
        """Size of the file and of its log."""
        sizes = 0
        for path in (self._path, self._path.with_name(f"{self._path.name}-wal")):
            with contextlib.suppress(OSError):
                sizes += path.stat().st_size
        return sizes

    def _stations(self, database: sqlite3.Connection, batch: Batch) -> dict[str, int]:
        """Number of each station in a batch; unknown ones get one."""
        names = {row.station for row in batch.samples} | {row.station for row in batch.events}
        ids = {name: self._ids[name] for name in names if name in self._ids}
        for name in sorted(names - ids.keys()):
            database.execute("INSERT OR IGNORE INTO station (name) VALUES (?)", (name,))
            (ids[name],) = database.execute("SELECT id FROM station WHERE name = ?", (name,)).fetchone()
        return ids

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            try:
                self._writer.execute("BEGIN IMMEDIATE")
                yield self._writer
                self._writer.execute("COMMIT")
            except sqlite3.Error as error:
                raise StoreError(f"{self._path}: {error}") from error
            finally:
                if self._writer.in_transaction:
                    with contextlib.suppress(sqlite3.Error):
                        self._writer.execute("ROLLBACK")

    @contextlib.contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        try:
            with contextlib.closing(sqlite3.connect(self._path, timeout=BUSY_S)) as database:
                database.execute("PRAGMA query_only = 1")
                yield database
        except sqlite3.Error as error:
            raise StoreError(f"{self._path}: {error}") from error

    def _open(self) -> sqlite3.Connection:
        database = sqlite3.connect(self._path, timeout=BUSY_S, isolation_level=None, check_same_thread=False)
        try:
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA synchronous = FULL")
            (version,) = database.execute("PRAGMA user_version").fetchone()
            if version == 0:
                database.executescript(f"BEGIN IMMEDIATE; {_SCHEMA} COMMIT;")
            database.execute("SELECT count(*) FROM station").fetchone()
        except BaseException:
            database.close()
            raise
        if version > VERSION:
            database.close()
            raise StoreError(f"{self._path}: version {version} is newer than {VERSION}, which this program knows")
        return database


def _digest(payload: bytes) -> bytes:
    return hashlib.blake2b(payload, digest_size=8).digest()


def _put_aside(path: Path) -> Path:
    """Rename a database and its log, so that they can be looked at."""
    number = 1
    while (aside := path.with_name(f"{path.name}.refused-{number}")).exists():
        number += 1
    for suffix in ("", "-wal", "-shm"):
        with contextlib.suppress(FileNotFoundError):
            path.with_name(path.name + suffix).replace(aside.with_name(aside.name + suffix))
    return aside
