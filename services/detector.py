"""The detector daemon: samples from the bus in, verdicts on the bus out."""

import asyncio
import contextlib
import logging
from collections import Counter, OrderedDict

from wetwell.detector.dispatch import Costs
from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.protocols.keys import order_key, sample_key, verdict_key
from wetwell.protocols.link import Bus
from wetwell.protocols.messages import MessageError, Order, Sample, Verdict
from wetwell.protocols.station import Station
from wetwell.services.bus import connect
from wetwell.services.checkpoint import Checkpoint
from wetwell.services.daemon import report_health, stop_event, until
from wetwell.services.model_publisher import ModelPublisher
from wetwell.services.settings import Settings

log = logging.getLogger(__name__)

SAMPLE_HISTORY = 600
VERDICT_HISTORY = 100
ORDERS = 100
"""Orders that are remembered with their answers, so that one that is sent again is not carried out twice."""


async def serve_detector(settings: Settings, station: Station) -> None:
    """Judge a station until stopped. A router that is away is waited for."""
    async with stop_event() as stop, contextlib.AsyncExitStack() as stack:
        running = asyncio.create_task(_run(settings, station, stack), name="detector.run")
        await until(stop, running)


async def _run(settings: Settings, station: Station, stack: contextlib.AsyncExitStack) -> None:
    bus = stack.enter_context(await connect(settings))
    checkpoint = Checkpoint(settings.detector.state_dir, station.name)
    judge = StationJudge(bus, station, settings.detector.costs)
    if checkpoint.restore(judge.detector):
        log.info("station '%s': goes on from its checkpoint", station.name)
    stack.callback(checkpoint.save, judge.detector)
    async with asyncio.TaskGroup() as group:
        group.create_task(_keep(checkpoint, judge, settings.detector.checkpoint_s), name="detector.checkpoint")
        group.create_task(judge.obey(), name="detector.orders")
        group.create_task(
            report_health(bus, station.name, "detector", settings.health.period_s, judge.figures),
            name="detector.health",
        )
        group.create_task(judge.run(), name="detector.judge")


async def _keep(checkpoint: Checkpoint, judge: "StationJudge", period_s: float) -> None:
    while True:
        await asyncio.sleep(period_s)
        checkpoint.save(judge.detector)


class StationJudge:
    """Feeds the detector of one station from a bus and publishes what it says."""

    def __init__(self, bus: Bus, station: Station, costs: Costs | None = None) -> None:
        self._station = station.name
        self.detector = Detector(station.name, nominal_of(station), costs)
        self._orders = bus.subscribe(order_key(station.name))
        self._samples = bus.subscribe(sample_key(station.name), history=SAMPLE_HISTORY)
        self._publishers = [
            bus.publisher(verdict_key(station.name, pump), history=VERDICT_HISTORY)
            for pump in range(1, len(station.pump) + 1)
        ]
        self._model = ModelPublisher(bus, station, self.detector)
        self._states: dict[int, str] = {}
        self._answers: OrderedDict[str, Verdict] = OrderedDict()
        self._counts: Counter[str] = Counter()

    async def run(self) -> None:
        """Judge for ever. A payload that is no sample is counted and left out."""
        log.info("station '%s': waiting for samples", self._station)
        while True:
            for payload in await self._samples.receive():
                self._take(payload)
            await asyncio.sleep(0)  # let the health figures out between batches

    async def obey(self) -> None:
        """Carry out the orders of operators for ever. One that is none is counted and left out."""
        while True:
            for payload in await self._orders.receive():
                self._carry_out(payload)

    def figures(self) -> dict[str, float]:
        """Health figures."""
        counts = {name: float(count) for name, count in (self.detector.counts | self._counts).items()}
        return counts | {"dropped": float(self._samples.dropped)}

    def _take(self, payload: bytes) -> None:
        try:
            sample = Sample.decode(payload)
        except MessageError as error:
            self._counts["malformed"] += 1
            log.warning("station '%s': %s", self._station, error)
            return
        if sample.station != self._station:
            self._counts["foreign"] += 1
            return
        try:
            verdicts = self.detector.update(sample)
        except Exception:  # one odd run must not take the station off
            self._counts["failures"] += 1
            log.exception("station '%s': sample %d could not be judged", self._station, sample.seq)
            return
        for verdict in verdicts:
            self._publish(verdict)

    def _carry_out(self, payload: bytes) -> None:
        try:
            order = Order.decode(payload)
        except MessageError as error:
            self._counts["malformed_orders"] += 1
            log.warning("station '%s': %s", self._station, error)
            return
        if order.station != self._station or order.pump > len(self._publishers):
            self._counts["foreign_orders"] += 1
            log.warning(
                "station '%s': %s", self._station, f"order for pump {order.pump} of '{order.station}' refused"
            )
            return
        if order.id in self._answers:
            self._publish(self._answers[order.id])  # sent again because the answer was lost
            return
        act = self.detector.rebaseline if order.act == "rebaseline" else self.detector.revert
        verdict = act(order.pump - 1, order.time)
        log.info("station '%s' pump %d: %s by %s", self._station, order.pump, order.act, order.by)
        evidence = verdict.evidence | {"order": order.id, "by": order.by}
        self._answers[order.id] = verdict.model_copy(update={"evidence": evidence})
        self._publish(self._answers[order.id])
        if len(self._answers) > ORDERS:
            self._answers.popitem(last=False)

    def _publish(self, verdict: Verdict) -> None:
        self._counts["verdicts"] += 1
        self._publishers[verdict.pump - 1].put(verdict.encode())
        self._model.take(verdict)
        if self._states.get(verdict.pump) != verdict.state:
            log.info("station '%s' pump %d: %s", self._station, verdict.pump, verdict.state)
        self._states[verdict.pump] = verdict.state
