"""Samples of many stations that wait for a judge: while it catches up, or while another process judges."""

import contextlib
import time
from collections import deque
from collections.abc import Iterator, Sequence

from wetwell.protocols.bus.interface import ALL_KEPT, Bus
from wetwell.protocols.bus.keys import sample_block_key, sample_key
from wetwell.protocols.messages.decoding import SampleMessage, samples_of
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock

CAPACITY = 200_000
"""Messages that wait to be judged; what publishers keep comes when there is room."""
BEHIND_BYTES = 512 * 1024 * 1024
"""Messages that wait while their stations catch up: what a thousand publishers keep."""


Stamp = tuple[int, int]
"""Time and number of a sample. [ns, -]"""


class Room:
    """Bytes that all stations that catch up may hold together, and how many messages had none."""

    def __init__(self, most_bytes: int = BEHIND_BYTES) -> None:
        self.free_bytes = most_bytes
        self.dropped = 0


class Waiting:
    """Messages of a station that wait while it catches up, as they came, for they are smaller so.

    Parameters
    ----------
    room : Room
        What it shares with the others.
    """

    def __init__(self, room: Room) -> None:
        self.messages: deque[tuple[bytes, type[SampleMessage]]] = deque()
        self.taken = 0
        self._room = room

    def extend(self, payloads: Sequence[bytes], kind: type[SampleMessage]) -> None:
        """Add messages; where there is no room the oldest of this station go."""
        for payload in payloads:
            self.messages.append((payload, kind))
            self._room.free_bytes -= len(payload)
        while self._room.free_bytes < 0 and len(self.messages) > 1:
            self.pop()
            self._room.dropped += 1

    def pop(self) -> tuple[bytes, type[SampleMessage]]:
        """Take the oldest message."""
        payload, kind = self.messages.popleft()
        self._room.free_bytes += len(payload)
        self.taken += 1
        return payload, kind

    def samples(self) -> Iterator[Sample]:
        """The samples in them, which go on waiting."""
        for message in self.messages:
            yield from _samples(message)

    def cut(self, last: Stamp) -> set[Stamp] | None:
        """Take the messages before the last sample of this stamp; those of the first that is left, as far as to it.

        None, and all messages wait on, if there is no such sample.
        """
        for number in range(len(self.messages), 0, -1):
            stamps = [stamp_of(one) for one in _samples(self.messages[number - 1])]
            if last in stamps:
                for _ in range(number - 1):
                    self.pop()
                return set(stamps[: len(stamps) - stamps[::-1].index(last)])
            if stamps and all(_is_before(stamp, last) for stamp in stamps):
                return None
        return None

    def is_before(self, last: Stamp) -> bool:
        """Whether the newest sample that waits is older than one of this stamp, or nothing waits."""
        newest = next(iter(_samples(self.messages[-1])), None) if self.messages else None
        return newest is None or _is_before(stamp_of(newest), last)


def stamp_of(sample: Sample) -> Stamp:
    """What tells a sample from others of its station."""
    return sample.time, sample.seq


def _is_before(stamp: Stamp, last: Stamp) -> bool:
    """Whether a sample was sent before another, by its time and by its number."""
    return stamp[0] < last[0] and stamp[1] < last[1]


def _samples(message: tuple[bytes, type[SampleMessage]]) -> list[Sample]:
    payload, kind = message
    with contextlib.suppress(MessageError):
        return samples_of(kind.decode(payload))
    return []


class Follower:
    """Hears the samples of stations, and lets those of the last time wait.

    Parameters
    ----------
    bus : Bus
    stations : sequence of str
    kept_s : float
        For so long on the wall samples wait: longer than a checkpoint gets old. [s]
    """

    def __init__(self, bus: Bus, stations: Sequence[str], kept_s: float = float("inf")) -> None:
        self.room = Room()
        self.waiting = {station: Waiting(self.room) for station in stations}
        self._keys: dict[str, tuple[Waiting, type[SampleMessage]]] = {
            key(station): (self.waiting[station], kind)
            for station in stations
            for key, kind in ((sample_key, Sample), (sample_block_key, SampleBlock))
        }
        self._kept_s = kept_s
        self._came: deque[tuple[float, Waiting, int]] = deque()
        self.samples = bus.collect(list(self._keys), history=ALL_KEPT, capacity=CAPACITY)

    def is_ready(self) -> bool:
        """Whether all samples have come that publishers keep."""
        return not self.samples.is_behind

    async def run(self) -> None:
        """Let what comes wait, for ever."""
        while True:
            messages = await self.samples.receive()
            now_s = time.monotonic()
            for key, payload in messages:
                waiting, kind = self._keys[key]
                waiting.extend((payload,), kind)
                self._came.append((now_s, waiting, waiting.taken + len(waiting.messages)))
            while self._came[0][0] < now_s - self._kept_s:
                _, waiting, end = self._came.popleft()
                while waiting.taken < end:
                    waiting.pop()
