"""One station: its samples into the detector, verdicts and answers to orders out."""

import asyncio
import logging
import time
from collections import Counter, OrderedDict
from collections.abc import Iterable
from itertools import islice

from wetwell.detector.dispatch import Costs
from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.protocols.keys import verdict_key
from wetwell.protocols.link import Bus
from wetwell.protocols.messages import MessageError, Order, Sample, Verdict
from wetwell.protocols.station import Station
from wetwell.services.detector.checkpoint import Checkpoint, Told
from wetwell.services.detector.quarantine import Quarantine
from wetwell.services.model_publisher import ModelPublisher

log = logging.getLogger(__name__)

VERDICT_HISTORY = 100
ORDERS = 100
"""Orders that are remembered with their answers, so that one that is sent again is not carried out twice."""


class StationJudge:
    """Feeds the detector of one station and publishes what it says.

    Parameters
    ----------
    bus : Bus
        Where verdicts and models go to.
    station : Station
        What is judged.
    costs : Costs, optional
        For the expected cost of each act.
    checkpoint : Checkpoint, optional
        Where the state is kept; what it holds is taken up at once, and its last verdicts are published again.
    quarantine : Quarantine, optional
        What remembers at which station the process has died.
    """

    def __init__(
        self,
        bus: Bus,
        station: Station,
        costs: Costs | None = None,
        checkpoint: Checkpoint | None = None,
        quarantine: Quarantine | None = None,
    ) -> None:
        self.station = station.name
        self.detector = Detector(station.name, nominal_of(station), costs)
        self._checkpoint = checkpoint
        self._quarantine = quarantine or Quarantine(None, "", 1, 0.0)
        told = None if checkpoint is None else checkpoint.restore(self.detector)
        self.is_restored = told is not None
        self._publishers = [
            bus.publisher(verdict_key(station.name, pump), history=VERDICT_HISTORY)
            for pump in range(1, len(station.pump) + 1)
        ]
        self._model = ModelPublisher(bus, station, self.detector)
        self._last: dict[int, Verdict] = {}
        self._answers: OrderedDict[str, Verdict] = OrderedDict()
        self._counts: Counter[str] = Counter()
        self._heard_s = time.monotonic()
        if told is not None:
            log.info("station '%s': goes on from its checkpoint", self.station)
            self._answers.update(told.answers)
            for verdict in told.verdicts:
                self._publish(verdict)

    def take_payloads(self, payloads: Iterable[bytes]) -> None:
        """Judge what has come from the bus. A payload that is no sample is counted and left out."""
        self._quarantine.enter(self.station)
        for payload in payloads:
            self.take_payload(payload)
        self._quarantine.leave()
        self._heard_s = time.monotonic()

    async def take(self, samples: Iterable[Sample]) -> None:
        """Judge samples that come another way, such as from the historian."""
        left = iter(samples)
        while batch := list(islice(left, 100)):
            self._quarantine.enter(self.station)
            for sample in batch:
                self._judge(sample)
            self._quarantine.leave()
            await asyncio.sleep(0)

    def keep(self) -> None:
        """Save the state, if it is kept anywhere."""
        if self._checkpoint is not None:
            self._checkpoint.save(self.detector, self._told())

    async def keep_aside(self) -> None:
        """Save the state as `keep` does, the disk in a thread of its own."""
        if self._checkpoint is not None:
            await asyncio.to_thread(self._checkpoint.write, *self._checkpoint.encode(self.detector, self._told()))

    def _told(self) -> Told:
        return Told(self._answers, list(self._last.values()))

    def figures(self) -> dict[str, float]:
        """Health figures."""
        counts = {name: float(count) for name, count in (self.detector.counts | self._counts).items()}
        age_s = time.monotonic() - self._heard_s
        return counts | {"sample_age_s": age_s}

    def take_payload(self, payload: bytes) -> None:
        """Judge a sample; a payload that is none is counted and left out."""
        try:
            sample = Sample.decode(payload)
        except MessageError as error:
            self._counts["malformed"] += 1
            log.warning("station '%s': %s", self.station, error)
            return
        if sample.station != self.station:
            self._counts["foreign"] += 1
            return
        self._judge(sample)

    def _judge(self, sample: Sample) -> None:
        try:
            verdicts = self.detector.update(sample)
        except Exception:  # one odd run must not take the station off
            self._counts["failures"] += 1
            log.exception("station '%s': sample %d could not be judged", self.station, sample.seq)
            return
        for verdict in verdicts:
            self._publish(verdict)

    def take_order(self, payload: bytes) -> None:
        """Carry out an order, once; one that is none is counted and left out."""
        try:
            order = Order.decode(payload)
        except MessageError as error:
            self._counts["malformed_orders"] += 1
            log.warning("station '%s': %s", self.station, error)
            return
        if order.station != self.station or order.pump > len(self._publishers):
            self._counts["foreign_orders"] += 1
            log.warning("station '%s': %s", self.station, f"order for pump {order.pump} of '{order.station}' refused")
            return
        if order.id in self._answers:
            self._publish(self._answers[order.id])  # sent again because the answer was lost
            return
        act = self.detector.rebaseline if order.act == "rebaseline" else self.detector.revert
        verdict = act(order.pump - 1, order.time)
        log.info("station '%s' pump %d: %s by %s", self.station, order.pump, order.act, order.by)
        evidence = verdict.evidence | {"order": order.id, "by": order.by}
        self._answers[order.id] = verdict.model_copy(update={"evidence": evidence})
        if len(self._answers) > ORDERS:
            self._answers.popitem(last=False)
        self.keep()  # what was answered must be true after a kill
        self._publish(self._answers[order.id])

    def _publish(self, verdict: Verdict) -> None:
        self._counts["verdicts"] += 1
        self._publishers[verdict.pump - 1].put(verdict.encode())
        self._model.take(verdict)
        last = self._last.get(verdict.pump)
        if last is None or last.state != verdict.state:
            log.info("station '%s' pump %d: %s", self.station, verdict.pump, verdict.state)
        self._last[verdict.pump] = verdict
