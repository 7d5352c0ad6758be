"""Connections to a SQLite file of which a disk may have changed anything."""

import contextlib
import sqlite3
from pathlib import Path
from typing import Any

BUSY_S = 10.0
"""So long one process waits for another that writes."""
UNREADABLE = (sqlite3.DatabaseError, UnicodeDecodeError)
"""What reading a damaged file raises: what SQLite says of a broken name in the schema is no text for Python."""
UNKNOWN_FORMAT = "unsupported file format"
"""What SQLite says of a file whose head names a format of tables that no SQLite makes; it reads nothing of it."""
_WRITE_FORMAT_AT, _NEWEST_FORMAT = 18, 2
"""Place of the format for writing in the head of a file [byte], and the newest that SQLite has: with a log."""
_HEAD_BYTES = 100
_MAGIC = b"SQLite format 3\0"
_KNOWN_OF_HEAD = (
    (_WRITE_FORMAT_AT, (b"\1\1", b"\2\2")),  # for writing and reading: without a log, with one
    (21, (b"\x40\x20\x20",)),  # shares of a page
    (44, (b"\0\0\0\4",)),  # of tables
    (56, (b"\0\0\0\1",)),  # UTF-8
)
"""Places in the head of a file [byte], and all that can stand there in one that was made here, the usual one last."""


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


def broken_trees(database: sqlite3.Connection, most: int = 1) -> list[str]:
    """What SQLite finds wrong in its trees and pages, the first of it; empty if it finds nothing."""
    return [str(text) for (text,) in database.execute(f"PRAGMA integrity_check({most})") if text != "ok"]


def is_for_reading_only(path: Path) -> bool:
    """Whether the head of a file names a format that SQLite only reads; none is made like that."""
    try:
        with path.open("rb") as file:
            file.seek(_WRITE_FORMAT_AT)
            return file.read(1) > bytes([_NEWEST_FORMAT])
    except OSError:
        return False


def mend_head(path: Path) -> None:
    """Write what is known of the head of a damaged file into it, if it is one of SQLite: else no row can be read."""
    with contextlib.suppress(OSError), path.open("r+b") as file:
        head = file.read(_HEAD_BYTES)
        for place, known in _KNOWN_OF_HEAD if head.startswith(_MAGIC) else ():
            if head[place : place + len(known[-1])] not in known:
                file.seek(place)
                file.write(known[-1])


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
