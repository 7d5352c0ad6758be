"""How many rows of samples and messages a live database must hold, so that a missing one shows.

For each station and day a row counts them and adds up their checksums. Triggers keep it in the transaction that
writes or deletes, whoever does it. A row that was lost, such as by a page of an earlier time in the place of a later
one, leaves a count that nothing on the disk makes up.
"""

import sqlite3
from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple

from wetwell.protocols.timestamps import to_iso
from wetwell.services.historian.store.interface import DAY_NS

Counted = Literal["sample", "event"]

_BITS = 0xFFFF_FFFF
"""Of a CRC-32: a damaged one must not overflow the sum."""
MOST_DAYS = 100_000
"""From 1970; a stamp in nanoseconds reaches little further."""

_TALLY = """
CREATE TABLE tally (
    origin TEXT NOT NULL, station INTEGER NOT NULL, day INTEGER NOT NULL, rows INTEGER NOT NULL, crc INTEGER NOT NULL,
    PRIMARY KEY (origin, station, day)
) WITHOUT ROWID;
"""


def _statements(origin: Counted) -> str:
    """Count of the rows that a table has, and the triggers that keep it."""
    place = f"origin = '{origin}' AND station = OLD.station AND day = OLD.time_ns / {DAY_NS}"
    return f"""
INSERT INTO tally SELECT '{origin}', station, time_ns / {DAY_NS}, count(*), coalesce(sum(crc), 0) FROM {origin}
GROUP BY station, time_ns / {DAY_NS};
CREATE TRIGGER {origin}_comes AFTER INSERT ON {origin} BEGIN
    INSERT INTO tally VALUES ('{origin}', NEW.station, NEW.time_ns / {DAY_NS}, 1, coalesce(NEW.crc, 0))
    ON CONFLICT DO UPDATE SET rows = rows + 1, crc = crc + excluded.crc;
END;
CREATE TRIGGER {origin}_goes AFTER DELETE ON {origin} BEGIN
    UPDATE tally SET rows = rows - 1, crc = crc - coalesce(OLD.crc & {_BITS}, 0) WHERE {place};
    DELETE FROM tally WHERE {place} AND rows = 0 AND crc = 0;
END;
CREATE TRIGGER {origin}_gets_its_checksum AFTER UPDATE OF crc ON {origin} WHEN OLD.crc IS NULL BEGIN
    UPDATE tally SET crc = crc + NEW.crc WHERE {place};
END;
"""  # noqa: S608 - names of above


TALLY_TABLES = _TALLY + _statements("sample") + _statements("event")
"""Statements that make the tally of a database and count what is in it: a third of a microsecond a row."""

_MISCOUNTED = f"""
SELECT origin, station, day, sum(counted), sum(found), (SELECT name FROM station WHERE id = all_rows.station) FROM (
    SELECT 'sample' AS origin, station, time_ns / {DAY_NS} AS day, 0 AS counted, count(*) AS found, 0 AS was,
        coalesce(sum(crc & {_BITS}), 0) AS crc FROM sample GROUP BY 2, 3
    UNION ALL
    SELECT 'event', station, time_ns / {DAY_NS}, 0, count(*), 0,
        coalesce(sum(crc & {_BITS}), 0) FROM event GROUP BY 2, 3
    UNION ALL SELECT origin, station, day, rows, 0, crc, 0 FROM tally
) AS all_rows GROUP BY 1, 2, 3 HAVING sum(counted) != sum(found) OR sum(was) != sum(crc)
"""  # noqa: S608 - a number


class Miscount(NamedTuple):
    """A station and a day whose rows are not those that were counted."""

    origin: Counted
    station: int
    day: int
    counted: int
    found: int
    name: str | None

    def __str__(self) -> str:
        what = "rows of samples" if self.origin == "sample" else "messages"
        is_day = isinstance(self.day, int) and abs(self.day) <= MOST_DAYS  # a bit can turn a number into a text
        of = f"station '{self.name or self.station}' on {to_iso(self.day * DAY_NS)[:10] if is_day else self.day}"
        if self.counted > self.found:
            return f"{self.counted - self.found} {what} of {of} are missing"
        if self.counted < self.found:
            return f"{self.found - self.counted} {what} of {of} were put in"
        return f"{what} of {of} are others than were counted"


def miscounts(database: sqlite3.Connection) -> Iterator[Miscount]:
    """What a database does not hold as it was counted, seen at one moment."""
    yield from (Miscount(*row) for row in database.execute(_MISCOUNTED))


def settle(database: sqlite3.Connection, found: Iterable[Miscount]) -> None:
    """Count anew where a miscount was told, in a transaction of the caller: what is lost is told once."""
    for one in found:
        key = (one.origin, one.station, one.day)
        database.execute("DELETE FROM tally WHERE origin = ? AND station = ? AND day = ?", key)
        database.execute(
            f"INSERT INTO tally SELECT ?1, ?2, ?3, count(*), coalesce(sum(crc & {_BITS}), 0) FROM {one.origin} "  # noqa: S608
            f"WHERE station = ?2 AND time_ns / {DAY_NS} = ?3 HAVING count(*) > 0",
            key,
        )
