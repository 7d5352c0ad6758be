"""The store of a PostgreSQL database, in the schema `wetwell`; for people with SQL its view `wetwell.samples`."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, LiteralString

import numpy as np
import psycopg

from wetwell.protocols.quantities import pumps_of_width
from wetwell.services.historian.hours import Hours
from wetwell.services.historian.rows import HOUR_NS, unpack
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store.float_arrays import COPY_END, COPY_HEADER, copy_rows, from_postgres
from wetwell.services.historian.store.interface import (
    DAY_NS,
    Batch,
    EventKind,
    StationSpan,
    day_of,
    span_of,
)
from wetwell.services.historian.store.newest import LEAST_SAMPLES, MOST_LOOKED_AT, end_of_stretch_ns
from wetwell.services.historian.store.postgres_connection import PostgresConnection
from wetwell.services.historian.store.upkeep import Upkeep
from wetwell.services.historian.summary import MINUTE_NS, TEN_NS, Summary, fuller, joined
from wetwell.services.runtime.postgres import Fence

_SPANS: LiteralString = "SELECT name, coalesce(first_ns, 0), coalesce(last_ns, -1) FROM wetwell.station"


class PostgresStore:
    """A `Store` in PostgreSQL. It connects when it is first needed, and again after each failure.

    Parameters
    ----------
    url : str
        Such as `postgresql://user@host:5432/name`. It never appears in messages: it may hold a password.
    password_file : Path, optional
        File with the password.
    is_alone : bool
        Whether to be the one historian of this database.
    fence : Fence, optional
        Of one of a pair of historians.
    downsample_after_days, keep_days : int, optional
        As for a folder.

    Raises
    ------
    ConfigError
        If the URL is none.
    """

    def __init__(
        self,
        url: str,
        *,
        password_file: Path | None = None,
        is_alone: bool = True,
        fence: Fence | None = None,
        keep_live_days: int = 1,
        downsample_after_days: int | None = None,
        keep_days: int | None = None,
    ) -> None:
        self._connection = PostgresConnection(url, password_file, is_alone=is_alone, fence=fence)
        self._keep_live_days = keep_live_days
        self._downsample_after_days = downsample_after_days
        self._keep_days = keep_days
        self._upkeep = Upkeep(self, (self._sum_up, self._downsample, self._delete_old))

    @property
    def damages(self) -> int:
        """None: pages are checked by the database, if its `data_checksums` are on."""
        return 0

    def check_place(self) -> None:
        """Nothing: the database is where it is."""

    def mend(self) -> None:
        """Nothing: pages are checked by the database."""

    def hang_up(self) -> None:
        """End what waits for the database, which may be cut off."""
        self._connection.hang_up()

    def close(self) -> None:
        """Close the connection; twice is fine."""
        self._connection.close()

    def write(self, batch: Batch) -> int:
        """Keep a batch in one transaction."""
        spans = span_of(batch.samples)
        with self._connection.transaction() as database:
            names = {row.station for row in batch.samples} | {row.station for row in batch.events}
            database.cursor().executemany(
                "INSERT INTO wetwell.station (name) VALUES (%s) ON CONFLICT DO NOTHING",
                [(name,) for name in sorted(names)],
            )
            ids = dict(database.execute("SELECT name, id FROM wetwell.station WHERE name = ANY(%s)", (list(names),)))
            new = _copy(database, batch, ids)
            events = database.cursor()
            events.executemany(
                "INSERT INTO wetwell.event (kind, station, time_ns, digest, payload) VALUES (%s, %s, %s, %s, %s) "
                "ON CONFLICT DO NOTHING",
                [(row.kind, ids[row.station], row.time_ns, row.digest, row.payload.decode()) for row in batch.events],
            )
            database.cursor().executemany(
                "UPDATE wetwell.station SET first_ns = least(first_ns, %(first)s), "
                "last_ns = greatest(last_ns, %(last)s), summed_until_ns = least(summed_until_ns, %(day)s) "
                "WHERE id = %(id)s",
                [
                    {"first": first_ns, "last": last_ns, "day": day_of(first_ns), "id": ids[station]}
                    for station, (first_ns, last_ns) in sorted(spans.items())
                ],
            )
            new += events.rowcount if batch.events else 0
        self._upkeep.note(spans)
        return new

    def stations(self) -> list[StationSpan]:
        """All stations, by name."""
        return [StationSpan(*row) for row in self._connection.read(f"{_SPANS} ORDER BY 1")]

    def station(self, name: str) -> StationSpan | None:
        """One station; None if it is not known."""
        rows = self._connection.read(f"{_SPANS} WHERE name = %s", (name,))
        return StationSpan(*rows[0]) if rows else None

    def newest_ns(self, station: str) -> int | None:
        """Where the history of a station ends; what has become minutes is believed."""
        rows = self._connection.read(
            "SELECT time_ns, time_ns, 1 FROM wetwell.sample "
            "WHERE station = (SELECT id FROM wetwell.station WHERE name = %s) ORDER BY time_ns DESC LIMIT %s",
            (station, MOST_LOOKED_AT),
        )
        minutes = self._connection.read(
            "SELECT time_ns, time_ns, %s FROM wetwell.minute "
            "WHERE station = (SELECT id FROM wetwell.station WHERE name = %s) ORDER BY time_ns DESC LIMIT 1",
            (LEAST_SAMPLES, station),
        )
        return end_of_stretch_ns([*rows, *minutes])

    def days_ns(self, station: str, start_ns: int, end_ns: int) -> list[int]:
        """Beginnings of the days that have samples in a span."""
        rows = self._connection.read(
            "WITH RECURSIVE s AS (SELECT id FROM wetwell.station WHERE name = %(station)s), next AS ("
            "SELECT (SELECT min(time_ns) FROM wetwell.sample WHERE station = (SELECT id FROM s) "
            "AND time_ns >= %(start)s AND time_ns < %(end)s) AS at UNION ALL "
            "SELECT (SELECT min(time_ns) FROM wetwell.sample WHERE station = (SELECT id FROM s) "
            "AND time_ns >= ((floor(at::numeric / %(day)s) + 1) * %(day)s)::bigint AND time_ns < %(end)s) "
            "FROM next WHERE at IS NOT NULL) SELECT at FROM next WHERE at IS NOT NULL",
            {"station": station, "start": start_ns, "end": end_ns, "day": DAY_NS},
        )
        return [day_of(time_ns) for (time_ns,) in rows]

    def samples(self, station: str, start_ns: int, end_ns: int) -> Samples:
        """Samples of a span."""
        rows = self._connection.read(
            "SELECT time_ns, seq, quality, array_send(values) FROM wetwell.sample "
            "WHERE station = (SELECT id FROM wetwell.station WHERE name = %s) AND time_ns >= %s AND time_ns < %s",
            (station, start_ns, end_ns),
        )
        return Samples.of_rows(
            [(time_ns, seq, 1, quality, from_postgres(values)) for time_ns, seq, quality, values in rows]
        )

    def pumps(self, station: str, start_ns: int, end_ns: int) -> int | None:
        """Number of pumps that the samples of a span speak of; None if there are none."""
        ((width,),) = self._connection.read(
            "SELECT max(cardinality(values)) FROM wetwell.sample "
            "WHERE station = (SELECT id FROM wetwell.station WHERE name = %s) AND time_ns >= %s AND time_ns < %s",
            (station, start_ns, end_ns),
        )
        return None if width is None else pumps_of_width(width)

    def is_few(self, station: str, start_ns: int, end_ns: int, points: int) -> bool:
        """Whether a span has at most so many samples, and none that have become minutes."""
        ((samples, minutes),) = self._connection.read(
            "WITH s AS (SELECT id FROM wetwell.station WHERE name = %(station)s) SELECT "
            "(SELECT count(*) FROM (SELECT 1 FROM wetwell.sample WHERE station = (SELECT id FROM s) "
            "AND time_ns >= %(start)s AND time_ns < %(end)s LIMIT %(most)s) AS few), "
            "EXISTS (SELECT 1 FROM wetwell.minute WHERE station = (SELECT id FROM s) "
            "AND time_ns >= %(start)s AND time_ns < %(end)s)",
            {"station": station, "start": start_ns, "end": end_ns, "most": points + 1},
        )
        return samples <= points and not minutes

    def summary(self, station: str, start_ns: int, end_ns: int, span_ns: int) -> Summary:
        """Summary over equal spans from `start_ns` on, of ten minutes, samples, and minutes that they have become."""
        parts, tens_ns, first_ns = [], np.empty(0, dtype=np.int64), start_ns
        if start_ns % TEN_NS == end_ns % TEN_NS == span_ns % TEN_NS == 0:
            summed_ns = self._summed_until_ns(station)
            tens = self._kept("ten", station, start_ns, min(end_ns, summed_ns))
            parts.append(tens.over(start_ns, span_ns))
            tens_ns, first_ns = np.unique(tens.time_ns // DAY_NS * DAY_NS), max(start_ns, summed_ns)
        days_ns = self.days_ns(station, first_ns, end_ns)
        for day_ns in days_ns:
            day = Summary.of(self.samples(station, max(start_ns, day_ns), min(end_ns, day_ns + DAY_NS)))
            minutes = self._kept("minute", station, day_ns, day_ns + DAY_NS)
            if len(minutes):  # late samples, or a day that has become minutes just now
                day = fuller(minutes, day.over(day_ns, MINUTE_NS)).between(start_ns, end_ns)
            parts.append(day.over(start_ns, span_ns))
        minutes = self._kept("minute", station, start_ns, end_ns)
        known_ns = [*days_ns, *tens_ns]
        parts.append(minutes.select(~np.isin(minutes.time_ns // DAY_NS * DAY_NS, known_ns)).over(start_ns, span_ns))
        return joined(parts).over(start_ns, span_ns)

    def _kept(self, table: LiteralString, station: str, start_ns: int, end_ns: int) -> Summary:
        """Rows of `minute` or of `ten`."""
        rows = self._connection.read(
            "SELECT time_ns, array_send(count), array_send(mean), array_send(low), array_send(high) "  # noqa: S608
            f"FROM wetwell.{table} WHERE station = (SELECT id FROM wetwell.station WHERE name = %s) "
            "AND time_ns >= %s AND time_ns < %s ORDER BY time_ns",
            (station, start_ns, end_ns),
        )
        return Summary.of_rows([(time_ns, *map(from_postgres, arrays)) for time_ns, *arrays in rows])

    def events(self, kind: EventKind, station: str, start_ns: int, end_ns: int, last: int) -> list[bytes]:
        """The last so many verdicts or alarms, oldest first."""
        rows = self._connection.read(
            "SELECT payload FROM wetwell.event WHERE kind = %s "
            "AND station = (SELECT id FROM wetwell.station WHERE name = %s) AND time_ns >= %s AND time_ns < %s "
            "ORDER BY time_ns DESC, id DESC LIMIT %s",
            (kind, station, start_ns, end_ns, last),
        )
        return [payload.encode() for (payload,) in reversed(rows)]

    def hours(self, station: str, start_ns: int, end_ns: int) -> Hours:
        """Figures of the hours of days that are complete and summed up."""
        rows = self._connection.read(
            "SELECT hour_ns, array_send(values) FROM wetwell.hour JOIN wetwell.station ON station.id = hour.station "
            "WHERE name = %s AND hour_ns >= %s AND hour_ns < %s ORDER BY 1",
            (station, start_ns, end_ns),
        )
        return Hours.of_rows([(hour_ns, from_postgres(values)) for hour_ns, values in rows])

    def maintain(self, now_ns: int) -> str | None:
        """Sum up one complete day, or turn one old day into minutes, or delete what is too old."""
        return self._upkeep.one(now_ns)

    def scrub(self) -> Iterator[None]:
        """Nothing: pages are checked by the database."""
        return iter(())

    def figures(self) -> dict[str, float]:
        """Whether it is connected."""
        return {"is_connected": float(self._connection.is_connected)}

    def _sum_up(self, station: str, newest_ns: int) -> str | None:
        """Work out the hours of the oldest complete day that has none yet, or has had late samples since."""
        summed_ns = self._summed_until_ns(station)
        end_ns = newest_ns - self._keep_live_days * DAY_NS
        day_ns = next(iter(self.days_ns(station, summed_ns, end_ns)), None) if summed_ns < end_ns else None
        if day_ns is None:
            return None
        minutes = self._kept("minute", station, day_ns, day_ns + DAY_NS)
        around = self.samples(station, day_ns - HOUR_NS, day_ns + DAY_NS + HOUR_NS)
        hours = Hours.of_samples(around, day_ns, day_ns + DAY_NS)
        day = Summary.of(around.between(day_ns, day_ns + DAY_NS))
        if len(minutes):  # these are a few late samples
            day = fuller(minutes, day.over(day_ns, MINUTE_NS))
        with self._connection.transaction() as database:
            for hour_ns, data in [] if len(minutes) else hours.rows():
                database.execute(
                    "INSERT INTO wetwell.hour SELECT id, %b, %b::float8[] FROM wetwell.station WHERE name = %b "
                    "ON CONFLICT (station, hour_ns) DO UPDATE SET values = excluded.values",
                    (hour_ns, Hours.of_rows([(hour_ns, data)]).values[0].tolist(), station),
                )
            _replace(database, "ten", station, day_ns, day.over(day_ns, TEN_NS))
            database.execute(
                "UPDATE wetwell.station SET summed_until_ns = %s WHERE name = %s AND summed_until_ns = %s",
                (day_ns + DAY_NS, station, summed_ns),
            )
        return f"station '{station}': {len(hours)} hours summed up"

    def _summed_until_ns(self, station: str) -> int:
        """Until when each day has its hours and ten minutes; a late sample takes it back to its day."""
        rows = self._connection.read("SELECT summed_until_ns FROM wetwell.station WHERE name = %s", (station,))
        return rows[0][0] if rows else -(2**63)

    def _downsample(self, station: str, newest_ns: int) -> str | None:
        """Turn the samples of the oldest day into minutes, if it is old enough."""
        if self._downsample_after_days is None:
            return None
        days_ns = self.days_ns(station, -(2**63), newest_ns - self._downsample_after_days * DAY_NS)
        if not days_ns:
            return None
        day_ns = days_ns[0]
        samples = self.samples(station, day_ns, day_ns + DAY_NS)
        minutes = Summary.of(samples).over(day_ns, MINUTE_NS)
        minutes = fuller(self._kept("minute", station, day_ns, day_ns + DAY_NS), minutes)
        keys = list(zip(samples.time_ns.tolist(), samples.seq.tolist(), strict=True))
        with self._connection.transaction() as database:
            number = _replace(database, "minute", station, day_ns, minutes)
            database.execute(
                "DELETE FROM wetwell.sample WHERE station = %s AND (time_ns, seq) IN "
                "(SELECT * FROM unnest(%s::bigint[], %s::bigint[]))",
                (number, [key[0] for key in keys], [key[1] for key in keys]),
            )
        return f"station '{station}': {len(samples)} samples turned into {len(minutes)} minutes"

    def _delete_old(self, station: str, newest_ns: int) -> str | None:
        """Delete samples, minutes, verdicts and alarms that are too old."""
        if self._keep_days is None:
            return None
        deleted = 0
        with self._connection.transaction() as database:
            for table in ("sample", "minute", "ten", "event"):
                deleted += database.execute(
                    psycopg.sql.SQL(
                        "DELETE FROM {} WHERE station = (SELECT id FROM wetwell.station WHERE name = %s) "
                        "AND time_ns < %s {}"
                    ).format(
                        psycopg.sql.Identifier("wetwell", table),
                        psycopg.sql.SQL("AND kind != 'changes'" if table == "event" else ""),
                    ),
                    (station, newest_ns - self._keep_days * DAY_NS),
                ).rowcount
        return f"station '{station}': {deleted} old rows deleted" if deleted else None


def _replace(
    database: psycopg.Connection[Any], table: LiteralString, station: str, day_ns: int, rows: Summary
) -> int:
    """Put the rows of a day into `minute` or `ten` in place of those that are there; the number of the station."""
    ((number,),) = database.execute("SELECT id FROM wetwell.station WHERE name = %s", (station,)).fetchall()
    database.execute(
        f"DELETE FROM wetwell.{table} WHERE station = %s AND time_ns >= %s AND time_ns < %s",  # noqa: S608 - ours
        (number, day_ns, day_ns + DAY_NS),
    )
    database.cursor().executemany(
        f"INSERT INTO wetwell.{table} VALUES (%s, %s, %s, %s, %s, %s)",  # noqa: S608 - ours
        [(number, *row) for row in rows.lists()],
    )
    return int(number)


def _copy(database: psycopg.Connection[Any], batch: Batch, ids: dict[str, int]) -> int:
    """Samples, each a row, by COPY into a temporary table, and from there those that are new."""
    if not batch.samples:
        return 0
    stations = np.array([ids[row.station] for row in batch.samples])
    with database.cursor().copy("COPY incoming FROM STDIN (FORMAT BINARY)") as copy:
        copy.write(COPY_HEADER)
        for part in unpack([(row.time_ns, row.seq, row.size, row.quality, row.data) for row in batch.samples]):
            copy.write(copy_rows(stations[part.row], part.time_ns, part.seq, part.quality, part.values))
        copy.write(COPY_END)
    return database.execute(
        "INSERT INTO wetwell.sample SELECT * FROM incoming ORDER BY station, time_ns, seq ON CONFLICT DO NOTHING"
    ).rowcount
