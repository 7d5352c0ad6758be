"""Samples and orders of many stations from the bus to their judges: one subscription for all of them."""

import asyncio
import contextlib
from collections import deque
from collections.abc import Iterable, Sequence

from wetwell.protocols.history_messages import LONGEST_NS
from wetwell.protocols.keys import order_key, sample_key
from wetwell.protocols.link import Bus
from wetwell.protocols.messages import MessageError, Sample
from wetwell.services.detector.catch_up import missed_samples
from wetwell.services.detector.judge import StationJudge

SAMPLE_HISTORY = 600
CAPACITY = 1_000_000
"""Samples that wait to be judged: after a start a thousand publishers send what they keep."""
BEHIND = 10_000
"""Samples of one station that wait while it catches up."""
KEPT_S = 2.0
"""Time in which what publishers keep comes, even if some of it is lost on the way once."""
CATCH_UPS = 8
"""Stations that ask the historian at the same time."""
SLICE = 500
"""Samples that are judged before the other tasks have their turn."""


class Intake:
    """Feeds judges from a bus. What comes of a station while it catches up with the historian waits until then.

    Parameters
    ----------
    bus : Bus
    judges : sequence of StationJudge
    """

    def __init__(self, bus: Bus, judges: Sequence[StationJudge]) -> None:
        self._bus = bus
        self._judges = {sample_key(judge.station): judge for judge in judges}
        self._obeying = {order_key(judge.station): judge for judge in judges}
        self._behind: dict[str, deque[bytes]] = {
            sample_key(judge.station): deque(maxlen=BEHIND) for judge in judges if judge.is_restored
        }
        self._samples = bus.collect(list(self._judges), history=SAMPLE_HISTORY, capacity=CAPACITY)
        self._orders = bus.collect(list(self._obeying))

    @property
    def dropped(self) -> int:
        """Samples for which there was no room."""
        return self._samples.dropped

    async def run(self) -> None:
        """Judge for ever; restored stations take first what they have missed."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._judge(), name="detector.samples")
            group.create_task(self._obey(), name="detector.orders")
            turn = asyncio.Semaphore(CATCH_UPS)
            for key in list(self._behind):
                group.create_task(self._catch_up(key, turn), name=f"detector.missed.{self._judges[key].station}")

    async def _judge(self) -> None:
        while True:
            batches: dict[str, list[bytes]] = {}
            for key, payload in await self._samples.receive():
                batches.setdefault(key, []).append(payload)
            judged = 0
            for key, payloads in batches.items():
                if key in self._behind:
                    self._behind[key].extend(payloads)
                    continue
                self._judges[key].take_payloads(payloads)
                judged += len(payloads)
                if judged >= SLICE:
                    judged = 0
                    await asyncio.sleep(0)

    async def _obey(self) -> None:
        while True:
            for key, payload in await self._orders.receive():
                self._obeying[key].take_order(payload)

    async def _catch_up(self, key: str, turn: asyncio.Semaphore) -> None:
        """Take what was missed, then what came meanwhile.

        The bus keeps samples in the order in which they came, the historian in that of their stamps, which differs
        where a clock was set: only what the bus keeps no more is taken from the historian.
        """
        judge, waiting = self._judges[key], self._behind[key]
        last = judge.detector.last_heard
        await asyncio.sleep(KEPT_S)
        async with turn:
            until_ns = _begin_ns(waiting)
            async for samples in missed_samples(self._bus, judge.station, judge.detector.seen_until_ns, until_ns):
                if _place(last, waiting):
                    break
                await judge.take(samples)
                last = samples[-1].time, samples[-1].seq
        del self._behind[key]
        judge.take_payloads(list(waiting)[_place(last, waiting) :])


def _begin_ns(payloads: Iterable[bytes]) -> int:
    """Time of the first sample; as late as can be if there is none."""
    for payload in payloads:
        with contextlib.suppress(MessageError):
            return min(Sample.decode(payload).time, LONGEST_NS)
    return LONGEST_NS


def _place(last: tuple[int, int], payloads: Sequence[bytes]) -> int:
    """Place behind the sample of this time and number; 0 if it is not there.

    The detector takes a long row of samples that it has had for a clock that was set back.
    """
    for place in range(len(payloads), 0, -1):
        with contextlib.suppress(MessageError):
            sample = Sample.decode(payloads[place - 1])
            if (sample.time, sample.seq) == last:
                return place
    return 0
