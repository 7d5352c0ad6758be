"""A PostgreSQL database with the tables of the history, in the schema `wetwell`."""

import contextlib
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, LiteralString

import psycopg

from wetwell.services.historian.store.interface import StoreError
from wetwell.services.runtime.postgres import Fence, hang_up, server_name, with_password

POSTGRES_CONNECT_S = 5
LOCK = 0x77657477656C6C
"""Advisory lock that the one historian holds: "wetwell" in ASCII."""

_SCHEMA: LiteralString = """
CREATE SCHEMA IF NOT EXISTS wetwell;
CREATE TABLE IF NOT EXISTS wetwell.station (
    id serial PRIMARY KEY, name text NOT NULL UNIQUE, first_ns bigint, last_ns bigint,
    summed_until_ns bigint NOT NULL DEFAULT -9223372036854775808
);
CREATE TABLE IF NOT EXISTS wetwell.sample (
    station int NOT NULL, time_ns bigint NOT NULL, seq bigint NOT NULL, quality smallint NOT NULL,
    values float8[] NOT NULL, PRIMARY KEY (station, time_ns, seq)
);
CREATE TABLE IF NOT EXISTS wetwell.minute (
    station int NOT NULL, time_ns bigint NOT NULL, count float8[] NOT NULL, mean float8[] NOT NULL,
    low float8[] NOT NULL, high float8[] NOT NULL, PRIMARY KEY (station, time_ns)
);
DO $$ BEGIN
    IF to_regclass('wetwell.ten') IS NULL THEN
        CREATE TABLE wetwell.ten (LIKE wetwell.minute INCLUDING ALL);
        UPDATE wetwell.station SET summed_until_ns = DEFAULT; -- days of an earlier version get their ten minutes, too
    END IF;
END $$;
CREATE TABLE IF NOT EXISTS wetwell.event (
    id bigserial PRIMARY KEY, kind text NOT NULL, station int NOT NULL, time_ns bigint NOT NULL,
    digest bytea NOT NULL, payload text NOT NULL, UNIQUE (kind, station, time_ns, digest)
);
CREATE TABLE IF NOT EXISTS wetwell.hour (
    station int NOT NULL, hour_ns bigint NOT NULL, values float8[] NOT NULL, PRIMARY KEY (station, hour_ns)
);
CREATE OR REPLACE VIEW wetwell.samples AS
    SELECT name AS station, to_timestamp(time_ns / 1e9) AS time, seq, quality, values[1] AS level_m,
        values[2] AS inflow_m3h, values[3:] AS pumps
    FROM wetwell.sample JOIN wetwell.station ON station.id = sample.station;
"""

_INCOMING: LiteralString = """
CREATE TEMPORARY TABLE IF NOT EXISTS incoming (
    station int, time_ns bigint, seq bigint, quality smallint, values float8[]
) ON COMMIT DELETE ROWS
"""


class PostgresConnection:
    """One connection that writes, made when first needed and again after each failure, and one for each reading.

    Parameters
    ----------
    url : str
        It never appears in messages: it may hold a password.
    password_file : Path, optional
        File with the password.
    is_alone : bool
        Whether to be the one historian of this database.
    fence : Fence, optional
        Of one of a pair.

    Raises
    ------
    ConfigError
        If the URL is none.
    StoreError
        From every method, if the database cannot be used now.
    """

    def __init__(self, url: str, password_file: Path | None, *, is_alone: bool, fence: Fence | None = None) -> None:
        self._name = server_name(url, "historian.url")
        self._url = url
        self._password_file = password_file
        self._is_alone = is_alone
        self._fence = fence
        self._lock = threading.Lock()
        self._has_tables = False
        self._writer: psycopg.Connection[Any] | None = None

    @property
    def is_connected(self) -> bool:
        """Whether the connection that writes is there."""
        return self._writer is not None

    def hang_up(self) -> None:
        """End what waits for the database in another thread, which may be cut off."""
        if self._writer is not None and self._lock.locked():
            hang_up(self._writer)

    def close(self) -> None:
        """Close the connection that writes; twice is fine."""
        with self._lock:
            self._drop()

    @contextlib.contextmanager
    def transaction(self) -> Iterator[psycopg.Connection[Any]]:
        """The connection that writes, in a transaction."""
        with self._lock, self._errors():
            try:
                if self._writer is None:
                    self._writer = self._connect_writer()
                with self._writer.transaction():
                    yield self._writer
                    if self._fence is not None:
                        self._fence.check(self._writer)
            except (psycopg.Error, OSError):
                self._drop()
                raise

    def read(self, query: LiteralString, values: Any = ()) -> list[Any]:
        """Rows of a query, read on a connection of its own."""
        if not self._has_tables:
            with self.transaction():
                pass
        with self._errors(), self._connect() as database:
            database.read_only = True
            return database.cursor(binary=True).execute(query, values).fetchall()

    def _connect(self) -> psycopg.Connection[Any]:
        options = None if self._fence is None else self._fence.options
        return psycopg.connect(
            with_password(self._url, self._password_file), connect_timeout=POSTGRES_CONNECT_S, options=options
        )

    def _connect_writer(self) -> psycopg.Connection[Any]:
        database = self._connect()
        try:
            database.autocommit = True
            with database.transaction():
                database.execute("SELECT pg_advisory_xact_lock(%s)", (LOCK + 1,))  # one at a time makes the tables
                database.execute(_SCHEMA)
            database.execute(_INCOMING)
            self._has_tables = True
            if self._is_alone:
                self._hold(database)
        except BaseException:
            database.close()
            raise
        return database

    def _hold(self, database: psycopg.Connection[Any]) -> None:
        ((is_held,),) = database.execute("SELECT pg_try_advisory_lock(%s)", (LOCK,)).fetchall()
        if not is_held:
            raise StoreError(f"{self._name}: another historian works here")

    def _drop(self) -> None:
        if self._writer is not None:
            with contextlib.suppress(psycopg.Error):
                self._writer.close()
            self._writer = None

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except psycopg.Error as error:
            line = next(iter(str(error).strip().splitlines()), type(error).__name__)
            raise StoreError(f"{self._name}: {line}") from error
        except OSError as error:
            raise StoreError(f"historian.password_file: {error.strerror or error}") from error
