"""One connection to the PostgreSQL database of leases, and its tables, in the schema `wetwell`."""

import asyncio
import contextlib
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, LiteralString, TypeVar

import psycopg

from wetwell.protocols.errors import LinkError
from wetwell.services.runtime.postgres import hang_up, server_name, unfrozen, with_password

T = TypeVar("T")

LEASE_LOCK = 0x7765744C656173
"""Advisory lock of whoever makes the tables: "wetLeas" in ASCII."""

_TABLES: LiteralString = """
CREATE SCHEMA IF NOT EXISTS wetwell;
CREATE TABLE IF NOT EXISTS wetwell.lease (
    role text PRIMARY KEY, holder text NOT NULL, token bigint NOT NULL,
    since_s float8 NOT NULL, expires_s float8 NOT NULL
);
CREATE TABLE IF NOT EXISTS wetwell.member (
    role text NOT NULL, holder text NOT NULL, seen_s float8 NOT NULL, PRIMARY KEY (role, holder)
);
CREATE TABLE IF NOT EXISTS wetwell.state (
    role text NOT NULL, part text NOT NULL, token bigint NOT NULL, content bytea NOT NULL, PRIMARY KEY (role, part)
);
CREATE TABLE IF NOT EXISTS wetwell.stream (
    role text NOT NULL, key text NOT NULL, source bytea NOT NULL, sent bigint NOT NULL, PRIMARY KEY (role, key)
);
CREATE TABLE IF NOT EXISTS wetwell.message (
    role text NOT NULL, key text NOT NULL, number bigint NOT NULL, token bigint NOT NULL, payload bytea NOT NULL,
    PRIMARY KEY (role, key, number)
);
CREATE TABLE IF NOT EXISTS wetwell.line (
    role text NOT NULL, number bigint NOT NULL, token bigint NOT NULL, text text NOT NULL, PRIMARY KEY (role, number)
);
"""


class LeaseDatabase:
    """A connection, made when first needed and again after each failure. Each call is one transaction in a thread.

    A call that gets no answer in time is given up, and with it the connection: also where packets vanish. A
    transaction of a process that is frozen is ended by the server, so that its locks hold nobody up.

    Parameters
    ----------
    url : str
        It never appears in messages: it may hold a password.
    password_file : Path, optional
        File with the password.
    patience_s : float
        So long a call may take. [s]

    Raises
    ------
    ConfigError
        If the URL is none.
    """

    def __init__(self, url: str, password_file: Path | None, patience_s: float) -> None:
        self.name = server_name(url, "lease.url")
        self._url = url
        self._password_file = password_file
        self._patience_s = patience_s
        self._lock = threading.Lock()
        self._connection: psycopg.Connection[Any] | None = None

    async def call(self, work: Callable[[psycopg.Connection[Any]], T]) -> T:
        """What some work gives that is done in a transaction.

        Raises
        ------
        LinkError
            If the database does not answer in time, or refuses.
        """
        try:
            async with asyncio.timeout(self._patience_s):
                return await asyncio.to_thread(self._run, work)
        except TimeoutError as error:
            self._hang_up()
            raise LinkError(f"{self.name}: no answer within {self._patience_s:g} s") from error
        except asyncio.CancelledError:
            self._hang_up()
            raise

    def close(self) -> None:
        """Close the connection; twice is fine."""
        self._hang_up()
        with self._lock:
            self._drop()

    def _run(self, work: Callable[[psycopg.Connection[Any]], T]) -> T:
        with self._lock:
            try:
                if self._connection is None:
                    self._connection = self._connect()
                with self._connection.transaction():
                    return work(self._connection)
            except (psycopg.Error, OSError) as error:
                self._drop()
                line = next(iter(str(error).strip().splitlines()), type(error).__name__)
                raise LinkError(f"{self.name}: {line}") from error

    def _connect(self) -> psycopg.Connection[Any]:
        database = psycopg.connect(
            with_password(self._url, self._password_file),
            autocommit=True,
            connect_timeout=max(2, round(self._patience_s)),  # libpq takes two seconds at least
            options=unfrozen(self._patience_s),
        )
        with database.transaction():
            database.execute("SELECT pg_advisory_xact_lock(%s)", (LEASE_LOCK,))  # one at a time makes the tables
            database.execute(_TABLES)
        return database

    def _hang_up(self) -> None:
        """End a call that waits in another thread."""
        connection = self._connection
        if connection is None or not self._lock.locked():
            return
        hang_up(connection)

    def _drop(self) -> None:
        if self._connection is not None:
            with contextlib.suppress(psycopg.Error):
                self._connection.close()
            self._connection = None
