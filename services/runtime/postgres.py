"""What all connections to PostgreSQL share: how a call is given up, and what keeps an owner of the past out."""

import contextlib
import os
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psycopg
from psycopg.conninfo import conninfo_to_dict, make_conninfo

from wetwell.protocols.errors import ConfigError


@dataclass(frozen=True)
class Fence:
    """What keeps an owner of the past from writing.

    Attributes
    ----------
    check : callable
        Last act of each transaction; raises where another is the owner.
    options : str
        Of the connection: a transaction of a process that is frozen must end.
    """

    check: Callable[[psycopg.Connection[Any]], None]
    options: str


def server_name(url: str, setting: str) -> str:
    """Host and database of a URL, as messages say them: without its password.

    Raises
    ------
    ConfigError
        If the URL of the setting is none.
    """
    try:
        parts = conninfo_to_dict(url)
    except psycopg.ProgrammingError:
        raise ConfigError(f"{setting}: is no address of PostgreSQL (it is not shown, it may be secret)") from None
    return f"postgresql {parts.get('host', 'localhost')}/{parts.get('dbname', '')}"


def with_password(url: str, password_file: Path | None) -> str:
    """The URL with the password that the file holds now."""
    return make_conninfo(url, password=None if password_file is None else password_file.read_text().strip())


def hang_up(connection: psycopg.Connection[Any]) -> None:
    """End a call that waits in another thread, by closing its socket for both directions."""
    with contextlib.suppress(psycopg.Error, OSError):
        line = socket.socket(fileno=os.dup(connection.fileno()))
        with line:
            line.shutdown(socket.SHUT_RDWR)


def unfrozen(patience_s: float) -> str:
    """Options of a connection: the server ends a transaction whose process stands for so long. [s]."""
    milliseconds = max(1, round(1000.0 * patience_s))
    return f"-c idle_in_transaction_session_timeout={milliseconds} -c lock_timeout={milliseconds}"
