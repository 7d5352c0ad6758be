"""Samples and orders of many stations from the bus to their judges: one subscription for all of them."""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import maintenance_act_key, order_key, sample_block_key, sample_key
from wetwell.protocols.messages.decoding import SampleMessage, samples_of
from wetwell.protocols.messages.history import LONGEST_NS
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.services.detector.backfill import missed_samples
from wetwell.services.detector.follower import Follower, Stamp, Waiting, stamp_of
from wetwell.services.detector.station_detector import StationDetector

KEPT_S = 2.0
"""Time in which what publishers keep comes, even if some of it is lost on the way once."""
STILL_COMING_S = 30.0
"""So long at most what publishers keep may take, where it is much. [s]"""
LOOK_AGAIN_S = 0.05
BACKFILLS_AT_ONCE = 8
"""Stations that ask the historian at the same time."""
PAGES_KEPT = 2
"""Of what the historian gave: the last ones may come from their publishers, too, which keep less than a page."""
ORDERS_PACE_S = 0.1
"""Orders come from people. [s]"""
SAMPLES_AT_ONCE = 500
"""Samples that are judged before the other tasks have their turn."""


class Intake:
    """Feeds judges from a bus. What comes of a station while it catches up with the historian waits until then.

    Parameters
    ----------
    bus : Bus
    judges : sequence of StationDetector
    follower : Follower, optional
        Has heard the samples of all of them until now; its subscription goes on here.
    """

    def __init__(self, bus: Bus, judges: Sequence[StationDetector], follower: Follower | None = None) -> None:
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
        stations = [judge.station for judge in judges]
        if follower is None:
            follower = Follower(bus, stations)
            self._behind = {judge: follower.waiting[judge.station] for judge in judges if judge.is_restored}
        else:
            self._behind = {judge: follower.waiting[judge.station] for judge in judges}
        self._room = follower.room
        self._samples = follower.samples
        self._orders = bus.collect(list(self._obeying), pace_s=ORDERS_PACE_S)

    @property
    def dropped(self) -> int:
        """Messages for which there was no room."""
        return self._samples.dropped + self._room.dropped

    def is_behind(self, judge: StationDetector) -> bool:
        """Whether a judge has yet to take what it has missed."""
        return judge in self._behind

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
                if key not in self._judges:
                    continue  # of a station that is left out
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
        has_heard = judge.is_restored and judge.detector.seen_until_ns > 0  # else it has missed nothing
        judged = await self._reached(judge, waiting, turn) if has_heard else set()
        await _drain(judge, waiting, judged)
        del self._behind[judge]

    async def _reached(self, judge: StationDetector, waiting: Waiting, turn: asyncio.Semaphore) -> set[Stamp]:
        """Judge what lies before the samples that wait; which ones of those are judged already."""
        last = judge.last_heard
        judged = waiting.cut(last)
        if judged is not None:
            return judged
        await asyncio.sleep(KEPT_S)
        for _ in range(round(STILL_COMING_S / LOOK_AGAIN_S)):
            if not waiting.messages or not waiting.is_before(last):
                break
            await asyncio.sleep(LOOK_AGAIN_S)  # publishers send what they keep, the oldest first
        async with turn:
            judged = waiting.cut(last)
            first = next(waiting.samples(), None)
            if judged is not None or (first is not None and _follows(first, last)):
                return judged or set()
            pages: deque[set[Stamp]] = deque(maxlen=PAGES_KEPT)
            until_ns = LONGEST_NS if first is None else min(first.time, LONGEST_NS)
            since_ns = judge.detector.seen_until_ns
            if since_ns < last[0] < until_ns:
                since_ns = last[0]  # it came, though too far ahead to be let through
            async for samples in missed_samples(self._bus, judge.station, since_ns, until_ns):
                waits = {stamp_of(one) for one in waiting.samples()}
                missed = [one for one in samples if stamp_of(one) not in waits]
                await judge.judge_in_turns(missed)
                pages.append({stamp_of(one) for one in missed})
            return set().union(*pages)


async def _drain(judge: StationDetector, waiting: Waiting, known: set[Stamp]) -> None:
    """Judge what waits, but what is known, and what comes meanwhile, until nothing waits."""
    judged = 0
    while waiting.messages:
        payload, kind = waiting.pop()
        if known:
            message = judge.decoded(payload, kind)
            samples = [] if message is None else samples_of(message)
            judge.judge(one for one in samples if stamp_of(one) not in known)
            known -= {stamp_of(one) for one in samples}
            judged += len(samples)
        else:
            judged += judge.handle_payloads((payload,), kind)
        if judged >= SAMPLES_AT_ONCE and waiting.messages:
            judged = 0
            await asyncio.sleep(0)


def _follows(first: Sample, last: Stamp) -> bool:
    """Whether nothing lies between the last sample that was heard and the first that waits."""
    return first.time > last[0] and first.seq == last[1] + 1
