"""The historian without bus and clock: payloads in, batches to a store, answers out."""

import logging
import re
import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Literal

from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.history import LONGEST_NS
from wetwell.protocols.messages.maintenance import MaintenanceRecord
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import NAME_PATTERN
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.answers import answer
from wetwell.services.historian.changes import ChangeKeeper
from wetwell.services.historian.episodes import EpisodeKeeper
from wetwell.services.historian.rows import SampleRow, pack, pack_block
from wetwell.services.historian.spool import Row, Spool, size_of
from wetwell.services.historian.store.interface import Batch, EventRow, Store, StoreError

log = logging.getLogger(__name__)

MAX_NAME = 64
_NAME = re.compile(NAME_PATTERN)
SCRUBBED_AT_ONCE = 10
"""Days of a station that are looked through in each pause; a year of 1,000 stations takes a month."""
MAX_BATCH = 20_000
"""Samples, verdicts and alarms of one transaction."""

PayloadKind = Literal["samples", "blocks", "verdicts", "alarms", "maintenance"]
"""`samples` come one in a payload, `blocks` are many samples of a station in one."""


_EVENTS: Mapping[str, type[Verdict | Alarm | MaintenanceRecord]] = {
    "verdicts": Verdict,
    "alarms": Alarm,
    "maintenance": MaintenanceRecord,
}


class Historian:
    """Takes what the bus says, and keeps it in a store.

    What was handled waits in memory. `commit` gives it to the store; what it returns as committed is acknowledged:
    it survives a crash. While the store refuses, up to `spool_rows` wait; then the oldest are given up and counted as
    `lost`. All is counted in samples, verdicts and alarms, whether samples come alone or in blocks.

    Parameters
    ----------
    store : Store
    spool_rows : int
        Most samples, verdicts and alarms that wait, >= 1.

    Notes
    -----
    `handle` may be called from one thread, the others from any.
    """

    def __init__(self, store: Store, *, spool_rows: int = 500_000) -> None:
        self._store = store
        self._keepers = EpisodeKeeper(store), ChangeKeeper(store)
        self._spool_rows = spool_rows
        self._spool = Spool(spool_rows)
        self._counts: Counter[str] = Counter(
            dict.fromkeys(("taken", "committed", "doubled", "malformed", "failed_commits"), 0)
        )
        self._newest_ns = 0
        self._committed_at_ns: int | None = None
        self._is_failing = False
        self._commits = threading.Lock()
        self._scrubbing = store.scrub()

    def handle(self, kind: PayloadKind, payload: bytes) -> None:
        """Handle one payload; what is not of its kind is counted as `malformed` and left out."""
        try:
            rows = self._rows(kind, payload)
        except MessageError as error:
            self._counts["malformed"] += 1
            log.warning("%s", error)
            return
        self._counts["taken"] += size_of(rows)
        self._spool.put(rows)

    def _rows(self, kind: PayloadKind, payload: bytes) -> Sequence[Row]:
        """Rows of a payload; a verdict also brings those of the episodes and states that it changes.

        Raises
        ------
        MessageError
            If it is not what its key promises.
        """
        if kind == "samples" or kind == "blocks":  # noqa: PLR1714 - so its type is that of an event behind
            return _of_samples(kind, payload)
        event = _EVENTS[kind].decode(payload)
        _check(event.station, event.time)
        row = EventRow(kind, event.station, event.time, payload)
        if not isinstance(event, Verdict):
            return [row]
        return [row, *(more for keeper in self._keepers for more in keeper.rows(event))]

    def commit(self, now_ns: int) -> int:
        """Give what waits to the store, and return how many samples, verdicts and alarms are now acknowledged.

        A store that refuses is told once; what waits goes on waiting. What was found damaged is put aside even where
        nothing waits: until then nobody fetches again what was lost.
        """
        with self._commits:
            return self._commit(now_ns)

    def _commit(self, now_ns: int) -> int:
        acknowledged = 0
        while rows := self._spool.pop(MAX_BATCH):
            batch = Batch(
                samples=[row for row in rows if isinstance(row, SampleRow)],
                events=[row for row in rows if isinstance(row, EventRow)],
            )
            try:
                new = self._store.write(batch)
            except StoreError as error:
                self._spool.put_back(rows)
                self._say_failing(error)
                return acknowledged
            size = len(batch)
            acknowledged += size
            self._counts["committed"] += size
            self._counts["doubled"] += size - new
            self._newest_ns = max([self._newest_ns, *(row.last_ns for row in rows)])
        try:
            self._store.mend()
        except StoreError as error:
            self._say_failing(error)
            return acknowledged
        self._committed_at_ns = now_ns
        if self._is_failing:
            log.warning("the store keeps again; %d samples and messages were lost", self._spool.lost)
            self._is_failing = False
        return acknowledged

    @property
    def damages(self) -> int:
        """How often the store has put something aside that was not what was written."""
        return self._store.damages

    def check_place(self) -> None:
        """See whether what is written is where it is read.

        Raises
        ------
        StoreError
            If it is not, such as once a backup is in the place of the folder.
        """
        self._store.check_place()

    def answer(self, station: str, payload: bytes) -> bytes:
        """`History` that answers a `HistoryQuery`; knows what was committed."""
        return answer(self._store, station, payload).encode()

    def maintain(self, now_ns: int) -> bool:
        """One step of the store's maintenance; whether there may be more to do. A failure is told, and no end.

        Where nothing can be done, what is kept is looked through all the same: damage that is found is mended.
        """
        try:
            done = self._store.maintain(now_ns)
        except StoreError as error:
            self._counts["failed_maintenance"] += 1
            log.warning("%s", error)
            done = None
        if done is None:
            self._scrub()
            return False
        self._counts["maintained"] += 1
        log.info("%s", done)
        return True

    def _scrub(self) -> None:
        """Look through some more of what is kept, and begin again at the end."""
        try:
            for _ in range(SCRUBBED_AT_ONCE):
                next(self._scrubbing)
        except StopIteration:
            self._scrubbing = self._store.scrub()
            self._counts["scrubs"] += 1
        except StoreError as error:
            self._scrubbing = self._store.scrub()
            log.warning("%s", error)

    def figures(self, now_ns: int) -> dict[str, float]:
        """Health figures: counts; what waits; age of the last commit and of the newest row that is kept."""
        figures = {name: float(count) for name, count in self._counts.items()}
        figures["waiting"] = float(self._spool.waiting)
        figures["lost"] = float(self._spool.lost)
        figures["is_failing"] = float(self._is_failing)
        figures["damages"] = float(self.damages)
        if self._committed_at_ns is not None:
            figures["commit_age_s"] = (now_ns - self._committed_at_ns) / NS_PER_S
        if self._newest_ns:
            figures["lag_s"] = (now_ns - self._newest_ns) / NS_PER_S
        try:
            return figures | self._store.figures()
        except StoreError:
            return figures

    def _say_failing(self, error: StoreError) -> None:
        self._counts["failed_commits"] += 1
        if not self._is_failing:
            log.error("%s; up to %d samples and messages wait until it keeps again", error, self._spool_rows)
        self._is_failing = True


def _of_samples(kind: PayloadKind, payload: bytes) -> Sequence[Row]:
    """Rows of samples.

    Raises
    ------
    MessageError
        If the payload is not what its key promises.
    """
    if kind == "samples":
        sample = Sample.decode(payload)
        _check(sample.station, sample.time)
        return (pack(sample.station, sample),)
    block = SampleBlock.decode(payload)
    _check(block.station, max(block.time, key=abs))
    return pack_block(block)


def _check(station: str, time_ns: int) -> None:
    is_name = station == SITE or _NAME.match(station) is not None
    if len(station) > MAX_NAME or not is_name:
        raise MessageError(f"station: got {station[:MAX_NAME]!r}, must be a name of letters, digits and ._-")
    if abs(time_ns) > LONGEST_NS:
        raise MessageError(f"station '{station}': time {time_ns} ns lies too far from 1970")
