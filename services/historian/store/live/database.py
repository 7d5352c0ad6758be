"""What the SQLite database of the live days holds: samples, verdicts, alarms and figures of hours."""

import itertools
import operator
import sqlite3
import zlib
from collections.abc import Sequence
from typing import Any, get_args

from wetwell.protocols.quantities import pumps_of_width
from wetwell.services.historian.hours import Hours
from wetwell.services.historian.rows import HOUR_NS, PackedSamples, SampleRow, unpack
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store.interface import (
    DAY_NS,
    Batch,
    EventKind,
    EventRow,
    StationSpan,
    day_of,
    span_of,
)
from wetwell.services.historian.store.live.connection import of_key
from wetwell.services.historian.store.live.file import LiveFile
from wetwell.services.historian.store.live.row_checksum import (
    event_checksum,
    hour_checksum,
    is_event_intact,
    is_hour_intact,
    is_sample_intact,
    last_ns_of,
    sample_checksum,
)
from wetwell.services.historian.store.live.tally import MOST_DAYS

MOST_EVENTS = 1_000_000
"""Messages of one kind that are looked through at once: more than a station tells in a day."""

_SIZE = operator.attrgetter("size")
_SIZE_AND_KEY = operator.itemgetter(3, 0, 1, 2)
"""Size, station, time, `seq` of a `SampleRow`: inserting rows of a page together takes half the time."""

_STATION_SPANS = "SELECT name, coalesce(first_ns, 0), coalesce(last_ns, -1) FROM station"
_OF_STATION = "FROM sample WHERE station = (SELECT id FROM station WHERE name = :station) "
_LAST = "coalesce(last_ns, time_ns)"
_DAYS_OF_OTHERS = (
    f"SELECT time_ns / {DAY_NS} FROM event WHERE kind IN {get_args(EventKind)} "  # noqa: S608 - names
    "AND station = (SELECT id FROM station WHERE name = :station) "
    f"UNION SELECT hour_ns / {DAY_NS} FROM hour WHERE station = (SELECT id FROM station WHERE name = :station)"
)
"""Days of the messages and hours of a station; by its kinds an index has them."""
_TOUCHING = f"{_OF_STATION} AND time_ns >= :hour AND time_ns < :end AND {_LAST} >= :start "
"""Rows that may have a sample of a span: since a row keeps to its hour, none before the hour of the start has one."""

_INSERT_SAMPLE = (
    "INSERT INTO sample VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO UPDATE SET quality = excluded.quality, "
    "data = excluded.data, size = excluded.size, last_ns = excluded.last_ns, crc = excluded.crc "
    "WHERE CASE WHEN 'text' IN (typeof(quality), typeof(size), typeof(data), typeof(last_ns), typeof(crc)) THEN TRUE "
    "ELSE NOT is_intact(station, time_ns, seq, quality, size, data, last_ns, crc) END"
)
_INSERT_EVENT = (
    "INSERT INTO event (kind, station, time_ns, digest, payload, crc) VALUES (?, ?, ?, ?, ?, ?) "
    "ON CONFLICT (kind, station, time_ns, digest) DO UPDATE SET payload = excluded.payload, crc = excluded.crc "
    "WHERE payload != excluded.payload OR crc != excluded.crc"
)
"""What comes again changes nothing, unless it was damaged meanwhile.

No column of a sample is a text. What a disk has made one may be no UTF-8, which SQLite cannot give to `is_intact`.
"""

_PACKED = "time_ns, seq, size, quality, data, station, last_ns, crc, (SELECT id FROM station WHERE name = :station)"
"""A `PackedSamples`, and by what it is checked: a page that stands in the place of another has rows of elsewhere."""


class LiveDatabase:
    """Samples, verdicts, alarms and figures in a file of SQLite.

    Parameters
    ----------
    file : LiveFile

    Raises
    ------
    StoreError
        From every method, if the file cannot be used now.
    """

    def __init__(self, file: LiveFile) -> None:
        self._file = file

    def write(self, batch: Batch) -> int:
        """Keep a batch whole or not at all, and return how many samples, verdicts and alarms of it were new."""
        with self._file.transaction() as database:
            ids = self._stations(database, batch)
            new = 0
            for size, rows in itertools.groupby(sorted(batch.samples, key=_SIZE_AND_KEY), _SIZE):
                values = [
                    (
                        ids[row.station],
                        row.time_ns,
                        _key(row),
                        row.quality,
                        row.data,
                        size,
                        None if size == 1 else row.last_ns,
                        sample_checksum(ids[row.station], row.time_ns, _key(row), row.quality, size, row.data),
                    )
                    for row in rows
                ]
                new += size * database.executemany(_INSERT_SAMPLE, values).rowcount  # without those of triggers
            events = [_event_values(row, ids[row.station]) for row in batch.events]
            new += max(database.executemany(_INSERT_EVENT, events).rowcount, 0)  # -1 where there are none
            database.executemany(
                "UPDATE station SET first_ns = min(coalesce(first_ns, ?1), ?1), "
                "last_ns = max(coalesce(last_ns, ?2), ?2) WHERE id = ?3",
                [(*span, ids[station]) for station, span in span_of(batch.samples).items()],
            )
        self._file.ids |= ids
        return new

    def adopt(self, spans: Sequence[StationSpan]) -> None:
        """Take stations into the list that are not in it, or of which older or newer samples are kept elsewhere."""
        with self._file.transaction() as database:
            database.executemany(
                "INSERT INTO station (name, first_ns, last_ns) VALUES (?, ?, ?) ON CONFLICT (name) DO UPDATE SET "
                "first_ns = min(coalesce(first_ns, excluded.first_ns), excluded.first_ns), "
                "last_ns = max(coalesce(last_ns, excluded.last_ns), excluded.last_ns)",
                spans,
            )

    def stations(self) -> list[StationSpan]:
        """All stations, by name."""
        with self._file.reading() as database:
            return [StationSpan(*row) for row in database.execute(f"{_STATION_SPANS} ORDER BY 1")]

    def station(self, name: str) -> StationSpan | None:
        """One station; None if it is not known."""
        with self._file.reading() as database:
            row = database.execute(f"{_STATION_SPANS} WHERE name = ?", (name,)).fetchone()
            return None if row is None else StationSpan(*row)

    def samples(self, station: str, start_ns: int, end_ns: int) -> Samples:
        """Samples from `start_ns` until before `end_ns`."""
        with self._file.reading() as database:
            rows = database.execute(f"SELECT {_PACKED} {_TOUCHING}", _span(station, start_ns, end_ns)).fetchall()
        return Samples.of_rows(self._intact(rows)).between(start_ns, end_ns)

    def pumps(self, station: str, start_ns: int, end_ns: int) -> int | None:
        """Number of pumps that the samples of a span speak of; None if there are none."""
        if end_ns - start_ns < HOUR_NS:  # it may lie between two samples of a row
            samples = self.samples(station, start_ns, end_ns)
            return samples.pumps if len(samples) else None
        with self._file.reading() as database:
            (width,) = database.execute(
                f"SELECT max(length(data) / size / 8 - CASE size WHEN 1 THEN 0 ELSE 2 END) {_TOUCHING}",
                _span(station, start_ns, end_ns),
            ).fetchone()
        return None if width is None else pumps_of_width(int(width))

    def next_time_ns(self, station: str, start_ns: int) -> int | None:
        """Time of the first sample from `start_ns` on."""
        span = _span(station, start_ns, start_ns)
        with self._file.reading() as database:
            begun = database.execute(f"SELECT {_PACKED} {_TOUCHING}", span).fetchall()
            (time_ns,) = database.execute(f"SELECT min(time_ns) {_OF_STATION} AND time_ns >= :start", span).fetchone()
        times_ns = Samples.of_rows(self._intact(begun)).time_ns
        times_ns = times_ns[times_ns >= start_ns]
        return min([*times_ns[:1].tolist(), *([] if time_ns is None else [int(time_ns)])], default=None)

    def newest_times_ns(self, station: str, most: int) -> list[int]:
        """Times of the samples in the newest rows, at most so many rows, the newest first; each sample once."""
        with self._file.reading() as database:
            rows = database.execute(
                f"SELECT {_PACKED} {_OF_STATION} ORDER BY time_ns DESC LIMIT :most",
                {"station": station, "most": most},
            ).fetchall()
        times_ns: list[int] = Samples.of_rows(self._intact(rows)).time_ns[::-1].tolist()
        return times_ns

    def days_ns(self, station: str, start_ns: int, end_ns: int) -> list[int]:
        """Beginnings of the days that have samples in a span, in order."""
        days_ns = []
        next_ns = self.next_time_ns(station, start_ns)
        while next_ns is not None and next_ns < end_ns:
            days_ns.append(day_of(next_ns))
            next_ns = self.next_time_ns(station, days_ns[-1] + DAY_NS)
        return days_ns

    def days_of_all_ns(self, station: str) -> list[int]:
        """Beginnings of the days that have samples, messages or hours, in order.

        Messages and hours of a day stay here when its samples are in a file.
        """
        with self._file.reading() as database:
            found = database.execute(_DAYS_OF_OTHERS, {"station": station}).fetchall()
        others_ns = {day * DAY_NS for (day,) in found if isinstance(day, int) and abs(day) <= MOST_DAYS}
        return sorted(others_ns | set(self.days_ns(station, -(2**63), 2**63 - 1)))

    def count(self, station: str, start_ns: int, end_ns: int, most: int) -> int:
        """Number of samples of a span, up to `most`; one that came alone and in a row of several counts twice."""
        span = _span(station, start_ns, end_ns)
        with self._file.reading() as database:
            (whole,) = database.execute(
                f"SELECT coalesce(sum(size), 0) FROM (SELECT size {_OF_STATION} "  # noqa: S608 - as above
                f"AND time_ns >= :start AND time_ns < :end AND {_LAST} < :end LIMIT :most)",
                span | {"most": most},
            ).fetchone()
            if whole >= most:
                return most
            cut = database.execute(
                f"SELECT {_PACKED} {_TOUCHING} AND (time_ns < :start OR {_LAST} >= :end)", span
            ).fetchall()
        return min(most, int(whole) + len(Samples.of_rows(self._intact(cut)).between(start_ns, end_ns)))

    def delete_samples(self, station: str, samples: Samples) -> None:
        """Delete the rows that hold these samples, and no others: what came meanwhile stays."""
        if not len(samples):
            return
        span = _span(station, int(samples.time_ns[0]), int(samples.time_ns[-1]) + 1)
        with self._file.transaction() as database:
            (count,) = database.execute(f"SELECT sum(size) {_TOUCHING}", span).fetchone()
            if count == len(samples):
                database.execute(f"DELETE {_TOUCHING}", span)
                return
            rows = database.execute(f"SELECT {_PACKED} {_TOUCHING}", span).fetchall()
            known = set(zip(samples.time_ns.tolist(), samples.seq.tolist(), strict=True))
            others = {
                number
                for part in unpack([row[:5] for row in rows])
                for number, *key in zip(part.row.tolist(), part.time_ns.tolist(), part.seq.tolist(), strict=True)
                if tuple(key) not in known
            }
            database.executemany(
                f"DELETE FROM sample WHERE {of_key('station', 'time_ns', 'seq')}",  # noqa: S608 - names of columns
                [(row[5], row[0], row[1]) for place, row in enumerate(rows) if place not in others],
            )

    def events(self, kind: EventKind, station: str, start_ns: int, end_ns: int, last: int) -> list[bytes]:
        """The last so many verdicts or alarms, oldest first."""
        with self._file.reading() as database:
            rows = database.execute(
                "SELECT kind, station, time_ns, digest, payload, crc, id FROM event WHERE kind = ? "
                "AND station = (SELECT id FROM station WHERE name = ?) "
                "AND time_ns >= ? AND time_ns < ? ORDER BY time_ns DESC, id DESC LIMIT ?",
                (kind, station, start_ns, end_ns, last),
            ).fetchall()
        intact = []
        for *row, number in reversed(rows):
            if row[0] != kind or not start_ns <= row[2] < end_ns:
                self._file.is_damaged = True  # a page in the place of another
            elif is_event_intact(*row):
                intact.append(row[4])
            else:
                self._file.refused.note("event", number)
        return intact

    def delete_events(self, station: str, end_ns: int) -> int:
        """Delete verdicts and alarms from before `end_ns`, but not what changed when; returns how many."""
        with self._file.transaction() as database:
            return database.execute(
                "DELETE FROM event WHERE station = (SELECT id FROM station WHERE name = ?) AND time_ns < ? "
                "AND kind != 'changes'",
                (station, end_ns),
            ).rowcount

    def hours(self, station: str, start_ns: int, end_ns: int) -> Hours:
        """Figures that `write_hours` has kept."""
        with self._file.reading() as database:
            rows = database.execute(
                "SELECT hour_ns, data, station, crc FROM hour "
                "WHERE station = (SELECT id FROM station WHERE name = ?) AND hour_ns >= ? AND hour_ns < ? ORDER BY 1",
                (station, start_ns, end_ns),
            ).fetchall()
        intact = []
        for hour_ns, data, number, crc in rows:
            if is_hour_intact(number, hour_ns, data, crc):
                intact.append((hour_ns, data))
            else:
                self._file.refused.note("hour", number, hour_ns)
        return Hours.of_rows(intact)

    def write_hours(self, station: str, hours: Hours) -> None:
        """Keep figures of hours, in place of earlier ones."""
        with self._file.transaction() as database:
            (number,) = database.execute("SELECT id FROM station WHERE name = ?", (station,)).fetchone()
            database.executemany(
                "REPLACE INTO hour VALUES (?, ?, ?, ?)",
                [(number, *row, hour_checksum(number, *row)) for row in hours.rows()],
            )

    def put_aside_damaged(self, station: str, start_ns: int, end_ns: int) -> int:
        """Put what is not what was written of a span aside, of samples, messages and hours; how many rows."""
        begun = f"SELECT {_PACKED} {_OF_STATION} AND time_ns >= :start AND time_ns < :end"
        with self._file.reading() as database:
            self._intact(database.execute(begun, _span(station, start_ns, end_ns)).fetchall())
        self.hours(station, start_ns, end_ns)
        for kind in get_args(EventKind):
            self.events(kind, station, start_ns, end_ns, MOST_EVENTS)
        damages = self._file.damages
        with self._file.transaction():
            pass
        return self._file.damages - damages

    def _stations(self, database: sqlite3.Connection, batch: Batch) -> dict[str, int]:
        """Number of each station in a batch; unknown ones get one."""
        names = {row.station for row in batch.samples} | {row.station for row in batch.events}
        ids = {name: self._file.ids[name] for name in names if name in self._file.ids}
        for name in sorted(names - ids.keys()):
            database.execute("INSERT OR IGNORE INTO station (name) VALUES (?)", (name,))
            (ids[name],) = database.execute("SELECT id FROM station WHERE name = ?", (name,)).fetchone()
        return ids

    def _intact(self, rows: Sequence[tuple[Any, ...]]) -> list[PackedSamples]:
        """Rows that are what was written; the others are told, and left out.

        One that says the time of its last sample wrongly is not found where that is: a new file will have it right.
        """
        intact: list[PackedSamples] = []
        for time_ns, seq, size, quality, data, station, last_ns, crc, asked in rows:
            if station != asked:
                self._file.is_damaged = True  # a page in the place of another
            elif is_sample_intact(station, time_ns, seq, quality, size, data, last_ns, crc):
                intact.append((time_ns, seq, size, quality, data))
                if last_ns != last_ns_of(size, data):
                    self._file.is_damaged = True
            else:
                self._file.refused.note("sample", station, time_ns, seq)
        return intact


def _span(station: str, start_ns: int, end_ns: int) -> dict[str, str | int]:
    """Values for `_TOUCHING`."""
    hour_ns = max(start_ns // HOUR_NS * HOUR_NS, -(2**63))
    return {"station": station, "hour": hour_ns, "start": start_ns, "end": end_ns}


def _event_values(row: EventRow, station: int) -> tuple[str, int, int, bytes, bytes, int]:
    crc = event_checksum(row.kind, station, row.time_ns, row.payload)
    return row.kind, station, row.time_ns, row.digest, row.payload, crc


def _key(row: SampleRow) -> int:
    """Number of a sample, or of several samples one below 0 from all of their times and numbers."""
    return row.seq if row.size == 1 else -1 - zlib.crc32(row.data[-16 * row.size :])
