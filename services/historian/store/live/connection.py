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


def _text(content: bytes) -> str:
    return content.decode(errors="replace")
