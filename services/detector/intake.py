"""Samples and orders of many stations from the bus to their judges: one subscription for all of them."""

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence

from wetwell.protocols.bus.interface import ALL_KEPT, Bus
from wetwell.protocols.bus.keys import maintenance_act_key, order_key, sample_block_key, sample_key
from wetwell.protocols.messages.decoding import SampleMessage, samples_of
from wetwell.protocols.messages.history import LONGEST_NS
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.services.detector.backfill import missed_samples
from wetwell.services.detector.station_detector import StationDetector

CAPACITY = 200_000
"""Messages that wait to be judged; what publishers keep comes when there is room."""
BEHIND_BYTES = 512 * 1024 * 1024
"""Messages that wait while their stations catch up: what a thousand publishers keep."""
KEPT_S = 2.0
"""Time in which what publishers keep comes, even if some of it is lost on the way once."""
BACKFILLS_AT_ONCE = 8
"""Stations that ask the historian at the same time."""
ORDERS_PACE_S = 0.1
"""Orders come from people. [s]"""
SAMPLES_AT_ONCE = 500
"""Samples that are judged before the other tasks have their turn."""


class Room:
    """Bytes that all stations that catch up may hold together."""

    def __init__(self, most_bytes: int = BEHIND_BYTES) -> None:
        self.free_bytes = most_bytes


class Waiting:
    """Messages of a station that wait while it catches up, as they came, for they are smaller so.

    Parameters
    ----------
    room : Room
        What it shares with the others.
    """

    def __init__(self, room: Room) -> None:
        self.messages: deque[tuple[bytes, type[SampleMessage]]] = deque()
        self.dropped = 0
        self._room = room

    def extend(self, payloads: Sequence[bytes], kind: type[SampleMessage]) -> None:
        """Add messages; where there is no room the oldest of this station go."""
        for payload in payloads:
            self.messages.append((payload, kind))
            self._room.free_bytes -= len(payload)
        while self._room.free_bytes < 0 and len(self.messages) > 1:
            self.pop()
            self.dropped += 1

    def pop(self) -> tuple[bytes, type[SampleMessage]]:
        """Take the oldest message."""
        payload, kind = self.messages.popleft()
        self._room.free_bytes += len(payload)
        return payload, kind

    def samples(self) -> Iterator[Sample]:
        """The samples in them, which go on waiting."""
        for payload, kind in self.messages:
            with contextlib.suppress(MessageError):
                yield from samples_of(kind.decode(payload))


class Intake:
    """Feeds judges from a bus. What comes of a station while it catches up with the historian waits until then.

    Parameters
    ----------
    bus : Bus
    judges : sequence of StationDetector
    """

    def __init__(self, bus: Bus, judges: Sequence[StationDetector]) -> None:
        self._bus = bus
        self._judges: dict[str, tuple[StationDetector, type[SampleMessage]]] = {
            key(judge.station): (judge, kind)
            for judge in judges
            for key, kind in ((sample_key, Sample), (sample_block_key, SampleBlock))
        }
        self._obeying: dict[str, Callable[[bytes], None]] = {}
        for judge in judges:
            self._obeying[order_key(judge.station)] = judge.handle_order
            self._obeying[maintenance_act_key(judge.station)] = judge.handle_maintenance
        room = Room()
        self._behind = {judge: Waiting(room) for judge in judges if judge.is_restored}
        self._passed_over = 0
        self._samples = bus.collect(list(self._judges), history=ALL_KEPT, capacity=CAPACITY)
        self._orders = bus.collect(list(self._obeying), pace_s=ORDERS_PACE_S)

    @property
    def dropped(self) -> int:
        """Messages for which there was no room."""
        return self._samples.dropped + self._passed_over + sum(one.dropped for one in self._behind.values())

    async def run(self) -> None:
        """Judge for ever; restored stations take first what they have missed."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._judge(), name="detector.samples")
            group.create_task(self._obey(), name="detector.orders")
            turn = asyncio.Semaphore(BACKFILLS_AT_ONCE)
            for judge in list(self._behind):
                group.create_task(self._backfill(judge, turn), name=f"detector.missed.{judge.station}")

    async def _judge(self) -> None:
        while True:
            batches: dict[str, list[bytes]] = {}
            for key, payload in await self._samples.receive():
                batches.setdefault(key, []).append(payload)
            judged = 0
            for key, payloads in batches.items():
                judge, kind = self._judges[key]
                if judge in self._behind:
                    self._behind[judge].extend(payloads, kind)
                    continue
                judged += judge.handle_payloads(payloads, kind)
                if judged >= SAMPLES_AT_ONCE:
                    judged = 0
                    await asyncio.sleep(0)

    async def _obey(self) -> None:
        while True:
            for key, payload in await self._orders.receive():
                self._obeying[key](payload)

    async def _backfill(self, judge: StationDetector, turn: asyncio.Semaphore) -> None:
        """Take what was missed, then what came meanwhile.

        The bus keeps samples in the order in which they came, the historian in that of their stamps, which differs
        where a clock was set: only what the bus keeps no more is taken from the historian.
        """
        waiting = self._behind[judge]
        last = judge.detector.last_heard
        await asyncio.sleep(KEPT_S)
        async with turn:
            first = next(waiting.samples(), None)
            until_ns = LONGEST_NS if first is None else min(first.time, LONGEST_NS)
            if first is None or not _follows(first, last):
                async for samples in missed_samples(self._bus, judge.station, judge.detector.seen_until_ns, until_ns):
                    if _place(last, waiting.samples()):
                        break
                    await judge.judge_in_turns(samples)
                    last = samples[-1].time, samples[-1].seq
            await _drain(judge, waiting, _place(last, waiting.samples()))
            self._passed_over += self._behind.pop(judge).dropped


async def _drain(judge: StationDetector, waiting: Waiting, place: int) -> None:
    """Judge what waits from a place on, and what comes meanwhile, until nothing waits."""
    judged = 0
    while waiting.messages:
        message = judge.decoded(*waiting.pop())
        samples = [] if message is None else samples_of(message)
        judge.judge(samples[place:])
        place = max(place - len(samples), 0)
        judged += len(samples)
        if judged >= SAMPLES_AT_ONCE and waiting.messages:
            judged = 0
            await asyncio.sleep(0)


def _follows(first: Sample, last: tuple[int, int]) -> bool:
    """Whether nothing lies between the last sample that was heard and the first that waits."""
    return first.time > last[0] and first.seq == last[1] + 1


def _place(last: tuple[int, int], samples: Iterable[Sample]) -> int:
    """Place behind the last sample of this time and number; 0 if it is not there."""
    return max((place for place, one in enumerate(samples, 1) if (one.time, one.seq) == last), default=0)
