"""The store of a folder: live days in SQLite, complete ones in Parquet, read as one."""

import contextlib
import logging
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

from wetwell.protocols.errors import ConfigError
from wetwell.services.historian.hours import Hours
from wetwell.services.historian.rows import HOUR_NS
from wetwell.services.historian.samples import Samples, merged
from wetwell.services.historian.store.archive import Archive, DamagedDayError, Form
from wetwell.services.historian.store.file_query import Named, summary_of_files
from wetwell.services.historian.store.interface import (
    DAY_NS,
    Batch,
    EventKind,
    StationSpan,
    StoreError,
    day_of,
    span_of,
)
from wetwell.services.historian.store.live.database import LiveDatabase
from wetwell.services.historian.store.live.file import LiveFile
from wetwell.services.historian.store.newest import LEAST_SAMPLES, MOST_LOOKED_AT, end_of_stretch_ns
from wetwell.services.historian.store.upkeep import Upkeep
from wetwell.services.historian.summary import MINUTE_NS, TEN_NS, Summary, fuller, joined
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.folder_lock import Hold, folder_held
from wetwell.services.security.audit import audit_in

log = logging.getLogger(__name__)


class FolderStore:
    """A `Store` in a folder, which is made if it is not there.

    Parameters
    ----------
    folder : Path
    keep_live_days : int
        Complete days that stay in the database before they become files.
    downsample_after_days, keep_days : int, optional
        Age at which samples become minutes, and at which they and the verdicts and alarms are deleted. The age of a
        day counts from the newest sample of its station, but never from a time in the future.

    Raises
    ------
    StoreError
        If the folder cannot be used.
    """

    def __init__(
        self,
        folder: Path,
        *,
        keep_live_days: int = 1,
        downsample_after_days: int | None = None,
        keep_days: int | None = None,
    ) -> None:
        self._folder = folder
        self._keep_live_days = keep_live_days
        self._downsample_after_days = downsample_after_days
        self._keep_days = keep_days
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreError(f"{folder}: cannot be used: {error.strerror or error}") from error
        self._hold: Hold | None = None  # at work it is held
        self.file = LiveFile(folder / "live.sqlite", self.alone)
        self.live = LiveDatabase(self.file)
        if self.file.replaced is not None:
            act = "found a database that is not known as the last one"
            audit_in(folder, "history").note(now_ns(), act=act, reason=self.file.replaced)
        self.archive = Archive(folder)
        self._upkeep = Upkeep(self, (self._roll, self._sum_up, self._downsample, self._delete_old))
        self._refused_files = 0
        self._checked_ns = -(2**63)
        self._adopt()

    @property
    def damages(self) -> int:
        """How often something damaged was put aside."""
        return self.file.damages + self._refused_files

    def check_place(self) -> None:
        """See whether the folder that is held is still the one in its place."""
        try:
            if self._hold is not None:
                self._hold.check()
        except ConfigError as error:
            raise StoreError(str(error)) from error

    def close(self) -> None:
        """Close the database."""
        self.file.close()

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the folder, so that no second historian works on it; at work it is held already.

        Raises
        ------
        StoreError
            If another holds it, or it cannot be held.
        """
        with contextlib.ExitStack() as stack:
            if self._hold is None:
                stack.enter_context(self._held())
            yield

    @contextlib.contextmanager
    def _held(self) -> Iterator[Hold]:
        with contextlib.ExitStack() as stack:
            try:
                hold = stack.enter_context(folder_held(self._folder, "historian.folder", "historian"))
            except ConfigError as error:
                raise StoreError(str(error)) from error
            yield hold

    @contextlib.contextmanager
    def at_work(self) -> Iterator[None]:
        """Hold the folder as its one historian, and say at the end how far the database has come.

        Raises
        ------
        StoreError
            If another holds it, or it cannot be held.
        """
        with self._held() as hold:
            self._hold = hold
            try:
                yield
            finally:
                if not hold.is_lost:
                    self.file.mark_end()
                self._hold = None

    def write(self, batch: Batch) -> int:
        """Keep a batch in the database."""
        self.check_place()
        new = self.live.write(batch)
        self._upkeep.note(span_of(batch.samples))
        return new

    def mend(self) -> None:
        """Put aside what was found damaged, and has waited for the next writing."""
        if self.file.is_to_be_mended:
            self.write(Batch())

    def stations(self) -> list[StationSpan]:
        """All stations, by name."""
        return self.live.stations()

    def station(self, name: str) -> StationSpan | None:
        """One station; None if it is not known."""
        return self.live.station(name)

    def newest_ns(self, station: str) -> int | None:
        """Where the history of a station ends; a day in a file counts as one that is believed."""
        filed_ns = {*self.archive.days_ns("samples", station), *self.archive.days_ns("minutes", station)}
        of_files = [(day_ns, day_ns + DAY_NS - 1, LEAST_SAMPLES) for day_ns in sorted(filed_ns, reverse=True)]
        live = [(time_ns, time_ns, 1) for time_ns in self.live.newest_times_ns(station, MOST_LOOKED_AT)]
        return end_of_stretch_ns([*live, *of_files])

    def days_ns(self, station: str, start_ns: int, end_ns: int) -> list[int]:
        """Beginnings of the days that have samples in a span."""
        live_ns = self.live.days_ns(station, start_ns, end_ns)  # before the files: rows go from here to there
        return sorted({*live_ns, *self._filed("samples", station, start_ns, end_ns)})

    def samples(self, station: str, start_ns: int, end_ns: int) -> Samples:
        """Samples of a span; where file and database have the same one, that of the file."""
        live = self.live.samples(station, start_ns, end_ns)  # before the files, likewise
        filed = [self.archive.samples(station, day) for day in self._filed("samples", station, start_ns, end_ns)]
        return merged([*(each.between(start_ns, end_ns) for each in filed if each is not None), live])

    def pumps(self, station: str, start_ns: int, end_ns: int) -> int | None:
        """Number of pumps that the samples of a span speak of; None if there are none."""
        counts = [self.archive.pumps(station, day) for day in self._filed("samples", station, start_ns, end_ns)]
        live = self.live.pumps(station, start_ns, end_ns)
        return max(counts if live is None else [*counts, live], default=None)

    def is_few(self, station: str, start_ns: int, end_ns: int, points: int) -> bool:
        """Whether a span has at most so many samples, and none that have become minutes."""
        if self._filed("minutes", station, start_ns, end_ns):
            return False
        count = self.live.count(station, start_ns, end_ns, points + 1)
        for day_ns in self._filed("samples", station, start_ns, end_ns):
            if count > points:
                break
            count += self.archive.count(station, day_ns, start_ns, end_ns)
        return count <= points

    def summary(self, station: str, start_ns: int, end_ns: int, span_ns: int) -> Summary:
        """Summary of the days in files from their ten minutes or by DuckDB, of those in the database by NumPy."""
        try:
            return self._summary(station, start_ns, end_ns, span_ns)
        except StoreError:
            return self._summary(station, start_ns, end_ns, span_ns)  # a file has gone on while it was to be read

    def _summary(self, station: str, start_ns: int, end_ns: int, span_ns: int) -> Summary:
        live_ns = set(self.live.days_ns(station, start_ns, end_ns))
        of_samples = set(self._filed("samples", station, start_ns, end_ns))
        of_minutes = set(self._filed("minutes", station, start_ns, end_ns))
        parts = []
        if start_ns % TEN_NS == end_ns % TEN_NS == span_ns % TEN_NS == 0:
            tens = self._kept_tens(station, (of_samples | of_minutes) - live_ns)
            parts.append(joined(tens.values()).between(start_ns, end_ns).over(start_ns, span_ns))
            of_samples -= tens.keys()
            of_minutes -= tens.keys()
        for day_ns in sorted(live_ns | (of_samples & of_minutes)):
            day = Summary.of(self.samples(station, max(start_ns, day_ns), min(end_ns, day_ns + DAY_NS)))
            minutes = self.archive.minutes(station, day_ns)
            if minutes is not None:  # late samples, or a downsampling that was broken off
                day = fuller(minutes, day.over(day_ns, MINUTE_NS)).between(start_ns, end_ns)
            parts.append(day.over(start_ns, span_ns))
        filed: dict[Named, set[int]] = {
            "samples": of_samples - live_ns - of_minutes,
            "minutes": of_minutes - live_ns - of_samples,
        }
        for form, days_ns in filed.items():
            if days_ns:
                paths = [self.archive.path(form, station, day_ns) for day_ns in sorted(days_ns)]
                parts.append(summary_of_files(form, paths, start_ns, end_ns, start_ns, span_ns))
        return joined(parts).over(start_ns, span_ns)

    def _kept_tens(self, station: str, days_ns: set[int]) -> dict[int, Summary]:
        """Ten minutes of those days that have them; what cannot be read is worked out anew in time."""
        kept = {}
        for day_ns in sorted(days_ns):
            with contextlib.suppress(StoreError):
                tens = self.archive.tens(station, day_ns)
                if tens is not None:
                    kept[day_ns] = tens
        return kept

    def _filed(self, form: Form, station: str, start_ns: int, end_ns: int) -> list[int]:
        return [day_ns for day_ns in self.archive.days_ns(form, station) if start_ns - DAY_NS < day_ns < end_ns]

    def events(self, kind: EventKind, station: str, start_ns: int, end_ns: int, last: int) -> list[bytes]:
        """The last so many verdicts or alarms, oldest first."""
        return self.live.events(kind, station, start_ns, end_ns, last)

    def hours(self, station: str, start_ns: int, end_ns: int) -> Hours:
        """Figures of the hours of days that have a file."""
        return self.live.hours(station, start_ns, end_ns)

    def maintain(self, now_ns: int) -> str | None:
        """Turn one day into files, or one old file into minutes, or delete one that is too old.

        A damaged file that is in the way of it is put aside: it would hold up all that is due.
        """
        try:
            return self._upkeep.one(now_ns)
        except DamagedDayError as error:
            if not self.archive.put_aside_damaged(error.form, error.station, error.day_ns):
                raise
            self._refused_files += 1
            return f"station '{error.station}': a damaged file put aside"

    def scrub(self) -> Iterator[None]:
        """Look through all that is kept, a part at a time; what is damaged is put aside and told."""
        self.file.mark_end()
        self.file.check()
        yield
        for span in self.stations():
            for day_ns in self.live.days_of_all_ns(span.station):
                self.live.put_aside_damaged(span.station, day_ns, day_ns + DAY_NS)
                yield
        self._refused_files += self.archive.put_aside_damaged_ledgers() + self.archive.missing()
        yield
        for station in self.archive.stations():
            for form in get_args(Form):
                for day_ns in self.archive.days_ns(form, station):
                    self._refused_files += self.archive.look_at(form, station, day_ns)
                    yield

    def figures(self) -> dict[str, float]:
        """Size of the database, and what is free on its disk."""
        try:
            free = shutil.disk_usage(self._folder).free
        except OSError as error:
            raise StoreError(f"{self._folder}: {error.strerror or error}") from error
        return {"live_bytes": float(self.file.size_bytes()), "disk_free_bytes": float(free)}

    def _adopt(self) -> None:
        """Know the stations of the files, even if the database is new."""
        spans = []
        for station in self.archive.stations():
            days_ns = sorted({*self.archive.days_ns("samples", station), *self.archive.days_ns("minutes", station)})
            if days_ns:
                spans.append(StationSpan(station, days_ns[0], days_ns[-1] + DAY_NS - 1))
        try:
            self.live.adopt(spans)
        except StoreError:
            if not self.file.is_damaged:
                raise
            self.live.adopt(spans)  # into the new one

    def _complete_day_ns(self, station: str, newest_ns: int) -> int | None:
        """Oldest day in the database, if it is complete. [ns]."""
        first_ns = self.live.next_time_ns(station, -(2**63))
        if first_ns is None or day_of(first_ns) >= newest_ns - self._keep_live_days * DAY_NS:
            return None
        return day_of(first_ns)

    def _roll(self, station: str, newest_ns: int) -> str | None:
        """Write the files of the oldest day in the database that is complete, then delete its rows.

        A crash between leaves both; they are read once, and the step is done again. The first step of a day looks
        through the database before: SQLite trusts what a page says of its free space. Where a disk has changed that,
        all can be read, but to delete joins pages, and writes over rows that stay.
        """
        day_ns = self._complete_day_ns(station, newest_ns)
        if day_ns is not None and newest_ns > self._checked_ns:
            self.file.check()
            self._checked_ns = newest_ns
            day_ns = self._complete_day_ns(station, newest_ns)  # of what was found damaged nothing may be left
        if day_ns is None:
            return None
        if self.live.put_aside_damaged(station, day_ns, day_ns + DAY_NS):
            return f"station '{station}': damaged rows put aside"
        live = self.live.samples(station, day_ns, day_ns + DAY_NS)
        if not len(live):  # it lists rows that it does not find: it contradicts itself
            self.file.check()
            return None
        filed = self.archive.samples(station, day_ns)
        samples = live if filed is None else merged([filed, live])
        end_ns = day_ns + DAY_NS
        before, after = (
            self.samples(station, day_ns - HOUR_NS, day_ns),
            self.samples(station, end_ns, end_ns + HOUR_NS),
        )
        self.archive.write_samples(station, day_ns, samples)
        self._write_tens(station, day_ns, samples)
        if day_ns not in self.archive.days_ns("minutes", station):  # else these are a few late ones
            self.live.write_hours(station, Hours.of_samples(merged([before, samples, after]), day_ns, end_ns))
        self.live.delete_samples(station, live)
        return f"{self.archive.path('samples', station, day_ns)}: {len(samples)} samples"

    def _sum_up(self, station: str, _newest_ns: int) -> str | None:
        """Work out the ten minutes of a day that has none: one of an earlier version, or that were damaged."""
        days_ns = {*self.archive.days_ns("samples", station), *self.archive.days_ns("minutes", station)}
        day_ns = min(days_ns - {*self.archive.days_ns("tens", station)}, default=None)
        if day_ns is None:
            return None
        refused = sum(self.archive.put_aside_damaged(form, station, day_ns) for form in get_args(Named))
        self._refused_files += refused
        if refused:
            return f"station '{station}': damaged files put aside"
        samples = self.archive.samples(station, day_ns)
        self._write_tens(station, day_ns, Samples.of_rows([]) if samples is None else samples)
        return f"{self.archive.path('tens', station, day_ns)}: summed up"

    def _write_tens(self, station: str, day_ns: int, samples: Samples) -> None:
        """Sum up samples of a day, and minutes that earlier ones of it have become."""
        day, minutes = Summary.of(samples), self.archive.minutes(station, day_ns)
        if minutes is not None:
            day = fuller(minutes, day.over(day_ns, MINUTE_NS))
        self.archive.write_tens(station, day_ns, day.over(day_ns, TEN_NS))

    def _downsample(self, station: str, newest_ns: int) -> str | None:
        """Turn the oldest file of samples into minutes, if it is old enough."""
        days_ns = self.archive.days_ns("samples", station)
        if self._downsample_after_days is None or not days_ns:
            return None
        if days_ns[0] >= newest_ns - self._downsample_after_days * DAY_NS:
            return None
        day_ns = days_ns[0]
        samples = self.archive.samples(station, day_ns)
        if samples is None:
            return None
        minutes = Summary.of(samples).over(day_ns, MINUTE_NS)
        earlier = self.archive.minutes(station, day_ns)
        if earlier is not None:
            minutes = fuller(earlier, minutes)
        self.archive.write_minutes(station, day_ns, minutes)
        self.archive.delete("samples", station, day_ns)
        return f"{self.archive.path('minutes', station, day_ns)}: {len(minutes)} minutes"

    def _delete_old(self, station: str, newest_ns: int) -> str | None:
        """Delete what is too old: the oldest file, or verdicts and alarms."""
        if self._keep_days is None:
            return None
        end_ns = newest_ns - self._keep_days * DAY_NS
        for form in get_args(Form):
            days_ns = self.archive.days_ns(form, station)
            if days_ns and days_ns[0] < end_ns:
                self.archive.delete(form, station, days_ns[0])
                return f"{self.archive.path(form, station, days_ns[0])}: deleted"
        events = self.live.delete_events(station, end_ns)
        return f"station '{station}': {events} old verdicts and alarms deleted" if events else None
