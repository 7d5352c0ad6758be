"""The SQLite file of the live days: opened, written and read in whole steps, put aside when it is damaged.

A write-ahead log with `synchronous=FULL`: when a transaction has ended, its rows are on the disk and survive
`kill -9` and a power failure. One connection writes; each reading has a connection of its own and sees one moment.
"""

import contextlib
import logging
import sqlite3
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from wetwell.services.historian.store.interface import StoreError
from wetwell.services.historian.store.live.connection import (
    UNKNOWN_FORMAT,
    UNREADABLE,
    broken_trees,
    connect,
    is_for_reading_only,
    mend_head,
)
from wetwell.services.historian.store.live.end import COUNT_COMMIT, End, lost_of, read_end, write_end
from wetwell.services.historian.store.live.refused_rows import RefusedRows
from wetwell.services.historian.store.live.row_checksum import is_sample_intact
from wetwell.services.historian.store.live.salvage import salvage
from wetwell.services.historian.store.live.schema import mend_schema, prepare, schema_damages
from wetwell.services.historian.store.live.tally import miscounts, settle

log = logging.getLogger(__name__)

_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


class LiveFile:
    """A file of SQLite, made if it is not there, upgraded if it is of an earlier version.

    Parameters
    ----------
    path : Path
    alone : function
        Context in which no other historian works on the file, for the upgrade and to put it aside.

    Raises
    ------
    StoreError
        Here and from every method, if the file cannot be used now. A file that is damaged is put aside, and told,
        by the next writing; what can be read of it and is what was written goes into a new one.

    Attributes
    ----------
    ids : dict
        Number of each station, as far as it was asked for.
    refused : RefusedRows
        What is to be put aside by the next writing.
    is_damaged : bool
        Whether the file was found damaged, and not yet put aside.
    damages : int
        How often something was put aside, found missing, or written once more.
    replaced : str, optional
        Why the file is not known as the one that was here last, such as that of a backup.
    """

    def __init__(self, path: Path, alone: Callable[[], contextlib.AbstractContextManager[None]]) -> None:
        self._path = path
        self._alone = alone
        self._lock = threading.Lock()
        self.ids: dict[str, int] = {}
        self.refused = RefusedRows(path)
        self.is_damaged = False
        self.damages = 0
        self.replaced: str | None = None
        try:
            self._writer = self._open()
            self.replaced = lost_of(path, self._writer)
        except UNREADABLE as error:
            if isinstance(error, sqlite3.OperationalError) and not self._is_damage(error):
                raise StoreError(f"{path}: {error}") from error
            self._begin_anew(error)
        if self.replaced is not None:
            self.damages += 1
            log.error("%s: %s", path, self.replaced)
            self.mark_end()

    @property
    def is_to_be_mended(self) -> bool:
        """Whether something was found that the next writing puts aside."""
        return self.is_damaged or self.refused.are_any

    def mark_end(self) -> None:
        """Say in a file beside the database how far it has come, as the one historian that works on it."""
        with self._lock, contextlib.suppress(sqlite3.Error):  # its next use says what is wrong
            end = End.of(self._writer)
            if end != read_end(self._path):
                write_end(self._path, end)

    def close(self) -> None:
        """Close it; twice is fine."""
        with self._lock:
            self._writer.close()

    @contextlib.contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Connection of which all is kept at the end, or nothing; what is refused is put aside with it."""
        with self._lock:
            if self.is_damaged or (self.refused.are_any and self._has_broken_trees()):
                self._writer.close()
                self._begin_anew("damaged")
            try:
                self._writer.execute("BEGIN IMMEDIATE")
                aside = self.refused.put_aside(self._writer)
                yield self._writer
                self._writer.execute(COUNT_COMMIT)
                self._writer.execute("COMMIT")
                self.damages += aside.number
                self.is_damaged = self.refused.forget(aside) or self.is_damaged
            except (sqlite3.Error, UnicodeDecodeError) as error:
                self._note(error)
                raise StoreError(f"{self._path}: {error}") from error
            finally:
                if self._writer.in_transaction:
                    with contextlib.suppress(sqlite3.Error):
                        self._writer.execute("ROLLBACK")

    @contextlib.contextmanager
    def reading(self) -> Iterator[sqlite3.Connection]:
        """Connection that sees one moment."""
        try:
            with contextlib.closing(connect(self._path)) as database:
                database.execute("PRAGMA query_only = 1")
                yield database
        except (sqlite3.Error, UnicodeDecodeError) as error:
            self._note(error)
            raise StoreError(f"{self._path}: {error}") from error

    def check(self) -> None:
        """Look through the file, as far as SQLite and the tally know what must be in it.

        Damage is mended by the next writing. What is missing is told, and no longer counted.

        Raises
        ------
        StoreError
            If it is damaged, or cannot be read now.
        """
        with self.reading() as database:
            told = broken_trees(database) + schema_damages(database)
            found = [] if told else list(miscounts(database))
        if told:
            self.is_damaged = True
            raise StoreError(f"{self._path}: {told[0].splitlines()[-1]}")
        if found:
            with self.transaction() as database:
                settle(database, found)
            for one in found:
                log.error("%s: %s", self._path, one)
            self.damages += len(found)

    def size_bytes(self) -> int:
        """Size of the file and of its log."""
        sizes = 0
        for path in (self._path, self._path.with_name(f"{self._path.name}-wal")):
            with contextlib.suppress(OSError):
                sizes += path.stat().st_size
        return sizes

    def _has_broken_trees(self) -> bool:
        """Whether SQLite finds damage: of two tables that share a page, what one refuses may be rows of the other."""
        try:
            with self.reading() as database:
                return bool(broken_trees(database))
        except StoreError:
            if not self.is_damaged:
                raise
            return True

    def _note(self, error: sqlite3.Error | UnicodeDecodeError) -> None:
        """Know from now on that the file is damaged, if that is what the error says."""
        if isinstance(error, UnicodeDecodeError):
            if not error.object.startswith(b"malformed"):
                raise error
            self.is_damaged = True
        elif self._is_damage(error):
            self.is_damaged = True

    def _is_damage(self, error: sqlite3.Error) -> bool:
        """Whether an error of SQLite says that the file is damaged: one whose head forbids to use it is, too."""
        code = getattr(error, "sqlite_errorcode", None)
        if code in _DAMAGE or str(error) == UNKNOWN_FORMAT:
            return True
        return code == sqlite3.SQLITE_READONLY and is_for_reading_only(self._path)

    def _begin_anew(self, reason: object) -> None:
        """Put the file aside, and begin a new one with what can be read of it and is what was written.

        Raises
        ------
        StoreError
            If another historian works on it: that one has to do it; or if a new one cannot be begun now.
        """
        try:
            with self._alone():  # else the historian that works on it would go on in the file that is put aside
                aside = _put_aside(self._path)
                self.ids.clear()
                self._writer = self._open()
                mend_head(aside)
                mend_schema(aside)
                saved, lost = salvage(aside, self._writer)
                write_end(self._path, End.of(self._writer))
        except StoreError as error:
            raise StoreError(f"{self._path}: {reason}; {error}") from error
        except (sqlite3.Error, OSError) as error:
            raise StoreError(f"{self._path}: {error}") from error
        self.is_damaged = False
        self.damages += 1
        log.error(
            "%s: %s; kept as %s, a new one is begun with %d rows of it; at least %d are lost",
            self._path,
            reason,
            aside.name,
            saved,
            lost,
        )

    def _open(self) -> sqlite3.Connection:
        database = connect(self._path, isolation_level=None, check_same_thread=False)
        try:
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA synchronous = FULL")
            database.create_function("is_intact", 8, is_sample_intact, deterministic=True)
            prepare(database, self._path, self._alone)
            database.execute("SELECT count(*) FROM station").fetchone()
            damages = schema_damages(database)
        except BaseException:
            database.close()
            raise
        if damages:
            database.close()
            raise sqlite3.DatabaseError(damages[0])
        return database


def _put_aside(path: Path) -> Path:
    """Rename a database and its log, so that they can be looked at."""
    number = 1
    while (aside := path.with_name(f"{path.name}.refused-{number}")).exists():
        number += 1
    for suffix in ("", "-wal", "-shm"):
        with contextlib.suppress(FileNotFoundError):
            path.with_name(path.name + suffix).replace(aside.with_name(aside.name + suffix))
    return aside
