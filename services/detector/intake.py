"""Samples and orders of many stations from the bus to their judges: one subscription for all of them."""

import asyncio
from collections import deque
from collections.abc import Iterable, Iterator, Sequence

from wetwell.protocols.history_messages import LONGEST_NS
from wetwell.protocols.keys import order_key, sample_block_key, sample_key
from wetwell.protocols.link import Bus
from wetwell.protocols.messages import Sample
from wetwell.protocols.sample_block import SampleBlock
from wetwell.services.detector.catch_up import missed_samples
from wetwell.services.detector.judge import StationJudge, behind

SAMPLE_HISTORY = 600
CAPACITY = 1_000_000
"""Messages that wait to be judged: after a start a thousand publishers send what they keep."""
BEHIND = 10_000
"""Samples of one station that wait while it catches up."""
KEPT_S = 2.0
"""Time in which what publishers keep comes, even if some of it is lost on the way once."""
CATCH_UPS = 8
"""Stations that ask the historian at the same time."""
SLICE = 500
"""Messages that are judged before the other tasks have their turn."""


class Intake:
    """Feeds judges from a bus. What comes of a station while it catches up with the historian waits until then.

    Parameters
    ----------
    bus : Bus
    judges : sequence of StationJudge
    """

    def __init__(self, bus: Bus, judges: Sequence[StationJudge]) -> None:
        self._bus = bus
        self._judges: dict[str, tuple[StationJudge, type[Sample | SampleBlock]]] = {
            key(judge.station): (judge, kind)
            for judge in judges
            for key, kind in ((sample_key, Sample), (sample_block_key, SampleBlock))
        }
        self._obeying = {order_key(judge.station): judge for judge in judges}
        self._behind = {judge: deque[Sample](maxlen=BEHIND) for judge in judges if judge.is_restored}
        self._samples = bus.collect(list(self._judges), history=SAMPLE_HISTORY, capacity=CAPACITY)
        self._orders = bus.collect(list(self._obeying))

    @property
    def dropped(self) -> int:
        """Messages for which there was no room."""
        return self._samples.dropped

    async def run(self) -> None:
        """Judge for ever; restored stations take first what they have missed."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._judge(), name="detector.samples")
            group.create_task(self._obey(), name="detector.orders")
            turn = asyncio.Semaphore(CATCH_UPS)
            for judge in list(self._behind):
                group.create_task(self._catch_up(judge, turn), name=f"detector.missed.{judge.station}")

    async def _judge(self) -> None:
        while True:
            batches: dict[str, list[bytes]] = {}
            for key, payload in await self._samples.receive():
                batches.setdefault(key, []).append(payload)
            judged = 0
            for key, payloads in batches.items():
                judge, kind = self._judges[key]
                if judge in self._behind:
                    self._behind[judge].extend(_samples(judge, payloads, kind))
                    continue
                judge.take_payloads(payloads, kind)
                judged += len(payloads)
                if judged >= SLICE:
                    judged = 0
                    await asyncio.sleep(0)

    async def _obey(self) -> None:
        while True:
            for key, payload in await self._orders.receive():
                self._obeying[key].take_order(payload)

    async def _catch_up(self, judge: StationJudge, turn: asyncio.Semaphore) -> None:
        """Take what was missed, then what came meanwhile.

        The bus keeps samples in the order in which they came, the historian in that of their stamps, which differs
        where a clock was set: only what the bus keeps no more is taken from the historian.
        """
        waiting = self._behind[judge]
        last = judge.detector.last_heard
        await asyncio.sleep(KEPT_S)
        async with turn:
            until_ns = min(waiting[0].time, LONGEST_NS) if waiting else LONGEST_NS
            async for samples in missed_samples(self._bus, judge.station, judge.detector.seen_until_ns, until_ns):
                if any((sample.time, sample.seq) == last for sample in waiting):
                    break
                await judge.take(samples)
                last = samples[-1].time, samples[-1].seq
        del self._behind[judge]
        judge.take_samples(behind(last, list(waiting)))


def _samples(judge: StationJudge, payloads: Iterable[bytes], kind: type[Sample | SampleBlock]) -> Iterator[Sample]:
    """What is in payloads, one by one."""
    for payload in payloads:
        message = judge.decoded(payload, kind)
        if isinstance(message, SampleBlock):
            yield from message.samples()
        elif message is not None:
            yield message
