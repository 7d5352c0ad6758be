"""How far a live database had come, in a file beside it: an earlier one in its place, such as a backup, shows."""

import json
import logging
import sqlite3
from dataclasses import dataclass
from pathlib import Path

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError

log = logging.getLogger(__name__)

END_TABLES = """
CREATE TABLE head (name TEXT NOT NULL, commits INTEGER NOT NULL);
INSERT INTO head VALUES (lower(hex(randomblob(8))), 0);
"""
COUNT_COMMIT = "UPDATE head SET commits = commits + 1"


@dataclass(frozen=True)
class End:
    """Name that a database got when it was made, and how many commits it has had."""

    name: str
    commits: int

    @classmethod
    def of(cls, database: sqlite3.Connection) -> "End":
        """That of a database.

        Raises
        ------
        sqlite3.DatabaseError
            If it has none any more.
        """
        row = database.execute("SELECT name, commits FROM head").fetchone()
        if row is None or not isinstance(row[0], str) or not isinstance(row[1], int):
            raise sqlite3.DatabaseError("its head is damaged")
        return cls(*row)

    def lost_since(self, known: "End | None") -> str | None:
        """What is wrong with a database that ends here, where it had come so far; None if nothing is.

        Examples
        --------
        >>> End("a", 7).lost_since(End("a", 9))
        'commits 8 to 9 are missing: it is of an earlier time'
        """
        if known is None or (known.name == self.name and known.commits <= self.commits):
            return None
        if known.name != self.name:
            return "it is not the one that was here before"
        return f"commits {self.commits + 1} to {known.commits} are missing: it is of an earlier time"


def end_file_of(path: Path) -> Path:
    """File beside a database that says how far it had come."""
    return path.with_suffix(".end")


def read_end(path: Path) -> End | None:
    """How far a database had come; None where nobody has said it, or it cannot be read."""
    try:
        known = json.loads(end_file_of(path).read_bytes())
        return End(str(known["name"]), int(known["commits"]))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def lost_of(path: Path, database: sqlite3.Connection) -> str | None:
    """What is wrong with a database by the file beside it; None if nothing is.

    A file that is there and says nothing is not one that nobody has written: what it said is not known.

    Raises
    ------
    sqlite3.DatabaseError
        If the database does not say how far it has come.
    """
    known, end = read_end(path), End.of(database)  # in this order: the database only goes on
    if known is None and end_file_of(path).exists():
        return f"{end_file_of(path).name} cannot be read: nobody knows whether the database is of an earlier time"
    return end.lost_since(known)


def write_end(path: Path, end: End) -> None:
    """Say how far a database has come, after its commits are on the disk; a disk that refuses is told."""
    try:
        with atomic_file(end_file_of(path)) as file:
            file.write(json.dumps({"name": end.name, "commits": end.commits}).encode())
    except RecordingError as error:
        log.warning("%s", error)
