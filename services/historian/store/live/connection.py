"""Connections to a SQLite file of which a disk may have changed anything."""

import sqlite3
from pathlib import Path
from typing import Any

BUSY_S = 10.0
"""So long one process waits for another that writes."""
UNREADABLE = (sqlite3.DatabaseError, UnicodeDecodeError)
"""What reading a damaged file raises: what SQLite says of a broken name in the schema is no text for Python."""


def connect(place: Path | str, **options: Any) -> sqlite3.Connection:
    """Open a file so that a broken text in a row ends no reading: it is another text, and checksums tell.

    Parameters
    ----------
    place : Path or str
    options
        Of `sqlite3.connect`.

    Raises
    ------
    sqlite3.OperationalError
        If it cannot be opened.
    """
    database: sqlite3.Connection = sqlite3.connect(place, timeout=BUSY_S, **options)
    database.text_factory = _text
    return database


def of_key(*columns: str) -> str:
    """Condition of a row by its key, whose values are ?1, ?2 and so on: found by the order, and compared once more.

    Where a row between two pages is not where its key says, SQLite takes another one for it, and looks no further.

    Examples
    --------
    >>> of_key("station", "time_ns")
    'station = ?1 AND +station = ?1 AND time_ns = ?2 AND +time_ns = ?2'
    """
    return " AND ".join(f"{column} = ?{place} AND +{column} = ?{place}" for place, column in enumerate(columns, 1))


def _text(content: bytes) -> str:
    return content.decode(errors="replace")
