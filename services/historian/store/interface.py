"""What a store of the historian is: it keeps batches whole, and gives back what it has kept."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, Protocol

from wetwell.protocols.errors import WetwellError
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.hours import Hours
from wetwell.services.historian.rows import SampleRow
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.summary import Summary

DAY_NS = 86_400 * NS_PER_S

DIGEST_BYTES = 8

EventKind = Literal["verdicts", "changes", "alarms", "episodes", "maintenance"]


class StoreError(WetwellError):
    """A store cannot keep or give something now: disk full, database away."""


class EventRow(NamedTuple):
    """A verdict, its news, or an alarm, an episode or an act of maintenance after a change."""

    kind: EventKind
    station: str
    time_ns: int
    payload: bytes

    @property
    def size(self) -> int:
        """How many verdicts or alarms: one."""
        return 1

    @property
    def last_ns(self) -> int:
        """Its time."""
        return self.time_ns

    @property
    def digest(self) -> bytes:
        """Tells it from others of the same time."""
        return hashlib.blake2b(self.payload, digest_size=DIGEST_BYTES).digest()


@dataclass
class Batch:
    """What is kept together, or not at all; its length is the number of samples, verdicts and alarms."""

    samples: list[SampleRow] = field(default_factory=list)
    events: list[EventRow] = field(default_factory=list)

    def __len__(self) -> int:
        return sum(row.size for row in self.samples) + len(self.events)


class StationSpan(NamedTuple):
    """A station that a store knows, and the times of its first and last sample; 0 and -1 if there is none."""

    station: str
    first_ns: int
    last_ns: int


class Store(Protocol):
    """Where the history is kept. Every method raises `StoreError` if it cannot now.

    Characteristics: `write` and `maintain` exclude each other · reading is free to go on in other threads meanwhile.

    """

    @property
    def damages(self) -> int:
        """How often something that was not what was written has been put aside, or written once more."""

    def check_place(self) -> None:
        """See whether what is written is where it is read, and not in a folder that has been replaced."""

    def write(self, batch: Batch) -> int:
        """Keep a batch, and return how many samples, verdicts and alarms of it were new.

        When it returns, they survive a crash. Where a sample comes both alone and in a row of several, a store may
        call it new twice; it is read once.
        """

    def mend(self) -> None:
        """Put aside what was found not to be what was written, if anything was; each `write` does it, too."""

    def stations(self) -> list[StationSpan]:
        """All stations, by name."""

    def station(self, name: str) -> StationSpan | None:
        """One station; None if it is not known."""

    def newest_ns(self, station: str) -> int | None:
        """Where the history of a station ends, whatever stamp may lie far ahead of it; None if it has no samples."""

    def days_ns(self, station: str, start_ns: int, end_ns: int) -> list[int]:
        """Beginnings of the days that have samples from `start_ns` until before `end_ns`, in order."""

    def samples(self, station: str, start_ns: int, end_ns: int) -> Samples:
        """Samples from `start_ns` until before `end_ns`. Ask for days, see `blocks`, and not for years."""

    def pumps(self, station: str, start_ns: int, end_ns: int) -> int | None:
        """Number of pumps that the samples of a span speak of; None if there are none."""

    def is_few(self, station: str, start_ns: int, end_ns: int, points: int) -> bool:
        """Whether a span has at most so many samples, and none that have become minutes."""

    def summary(self, station: str, start_ns: int, end_ns: int, span_ns: int) -> Summary:
        """Summary over equal spans from `start_ns` on, of samples and of minutes that they have become.

        Where start, end and span are whole tens of minutes, a store may answer from summaries of ten minutes.
        """

    def events(self, kind: EventKind, station: str, start_ns: int, end_ns: int, last: int) -> list[bytes]:
        """The last so many verdicts or alarms, oldest first."""

    def hours(self, station: str, start_ns: int, end_ns: int) -> Hours:
        """Figures of hours that were worked out when their day was complete; the others are still in `samples`."""

    def maintain(self, now_ns: int) -> str | None:
        """One step of what must be done once in a while; what was done, or None if there is nothing to do."""

    def scrub(self) -> Iterator[None]:
        """Look through all that is kept, a part at a time; what is damaged is put aside, told and counted."""

    def figures(self) -> dict[str, float]:
        """Health figures."""

    def close(self) -> None:
        """Let go of files and connections."""


def blocks(store: Store, station: str, start_ns: int, end_ns: int) -> Iterator[Samples]:
    """Samples from `start_ns` until before `end_ns`, day by day."""
    for day_ns in store.days_ns(station, start_ns, end_ns):
        yield store.samples(station, max(start_ns, day_ns), min(end_ns, day_ns + DAY_NS))


def day_of(time_ns: int) -> int:
    """Beginning of the day in UTC of a time. [ns]."""
    return time_ns // DAY_NS * DAY_NS


def span_of(rows: Sequence[SampleRow]) -> dict[str, tuple[int, int]]:
    """Times of the first and last sample of each station in some rows."""
    spans: dict[str, tuple[int, int]] = {}
    for row in rows:
        first_ns, last_ns = spans.get(row.station, (row.time_ns, row.last_ns))
        spans[row.station] = (min(first_ns, row.time_ns), max(last_ns, row.last_ns))
    return spans
