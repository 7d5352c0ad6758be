"""One station: its samples into the detector, verdicts and answers to orders out."""

import asyncio
import logging
import time
from collections import Counter, OrderedDict
from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import Block
from wetwell.protocols.bus.interface import Outlet
from wetwell.protocols.bus.keys import maintenance_key, verdict_key
from wetwell.protocols.messages.decoding import SampleMessage, decoded
from wetwell.protocols.messages.maintenance import MaintenanceAct, MaintenanceRecord
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.order import Order
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.protocols.station.costs import Costs
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import to_iso
from wetwell.services.detector.checkpoint import Checkpoint, Told
from wetwell.services.detector.maintenance_log import MaintenanceLog
from wetwell.services.detector.model_publisher import ModelPublisher
from wetwell.services.detector.quarantine import Quarantine
from wetwell.services.detector.recent_verdicts import RecentVerdicts
from wetwell.services.runtime.clock import now_ns
from wetwell.services.security.audit import Audit

log = logging.getLogger(__name__)

VERDICT_HISTORY = 100
ACT_HISTORY = 100
ORDERS = 100
"""Orders that are remembered with their answers, so that one that is sent again is not carried out twice."""


class StationDetector:
    """Feeds the detector of one station and publishes what it says.

    Parameters
    ----------
    bus : Outlet
        Where verdicts and models go to.
    station : Station
        What is judged.
    costs : Costs, optional
        For the expected cost of each act.
    checkpoint : Checkpoint, optional
        Where the state is kept; what it holds is taken up at once, and the verdicts in it are published again.
    quarantine : Quarantine, optional
        What remembers at which station the process has died.
    audit : Audit, optional
        Where orders and acts of maintenance are written down; a disk that refuses holds up nothing.
    """

    def __init__(
        self,
        bus: Outlet,
        station: Station,
        costs: Costs | None = None,
        checkpoint: Checkpoint | None = None,
        quarantine: Quarantine | None = None,
        audit: Audit | None = None,
    ) -> None:
        self.station = station.name
        self._place = f"station '{station.name}': "
        self.detector = Detector.of(station, costs)
        self._checkpoint = checkpoint
        self._quarantine = quarantine or Quarantine(None, "", 1, 0.0)
        self._audit = audit or Audit(None)
        told = None if checkpoint is None else checkpoint.restore(self.detector)
        self.is_restored = told is not None
        self._heard = None if told is None else told.heard
        self._publishers = [
            bus.publisher(verdict_key(station.name, pump), history=VERDICT_HISTORY)
            for pump in range(1, len(station.pump) + 1)
        ]
        self._model = ModelPublisher(bus, station, self.detector)
        self._recent = RecentVerdicts(None if told is None else told.given_up)
        self._states: dict[int, State] = {}
        self._answers: OrderedDict[str, Verdict] = OrderedDict()
        self._counts: Counter[str] = Counter()
        self._heard_s = time.monotonic()
        self._acts_publisher = bus.publisher(maintenance_key(station.name), history=ACT_HISTORY)
        self._maintenance = MaintenanceLog(
            station.name, self.detector, self._publish_act, () if told is None else told.acts
        )
        if told is not None:
            log.info("station '%s': goes on from its checkpoint", self.station)
            self._answers.update(told.answers)
            self._tell_again(told.verdicts)

    def handle_payloads(self, payloads: Iterable[bytes], kind: type[SampleMessage] = Sample) -> int:
        """Judge what has come from the bus; how many samples. What is not of its kind is counted and left out."""
        samples = 0
        self._quarantine.enter(self.station)
        for payload in payloads:
            message = self.decoded(payload, kind)
            if isinstance(message, SampleBlock):
                self._judge_block(message)
                samples += len(message.seq)
            elif message is not None:
                self._judge(message)
                samples += 1
        self._quarantine.leave()
        return samples

    async def judge_in_turns(self, samples: Iterable[Sample]) -> None:
        """Judge samples that come another way, such as from the historian."""
        left = iter(samples)
        while batch := list(islice(left, 100)):
            self.judge(batch)
            await asyncio.sleep(0)

    def judge(self, samples: Iterable[Sample]) -> None:
        """Judge samples."""
        self._quarantine.enter(self.station)
        for sample in samples:
            self._judge(sample)
        self._quarantine.leave()

    def keep(self) -> None:
        """Save the state, if it is kept anywhere."""
        if self._checkpoint is not None:
            self._checkpoint.save(self.detector, self._told())

    async def keep_aside(self) -> None:
        """Save the state as `keep` does, the disk in a thread of its own."""
        if self._checkpoint is not None:
            await asyncio.to_thread(self._checkpoint.write, *self._checkpoint.encode(self.detector, self._told()))

    @property
    def last_heard(self) -> tuple[int, int]:
        """Time and number of the last sample that came; of a state of an earlier version what the detector knows."""
        return self._heard or self.detector.last_heard

    def _told(self) -> Told:
        acts = list(self._maintenance.records.values())
        return Told(self._answers, self._recent.payloads(), acts, self._heard, self._recent.given_up())

    def unproven(self) -> list[tuple[int, int]]:
        """Pump and time of verdicts that are told no more, and that nobody may have heard."""
        return [(pump, time_ns) for pump, times_ns in self._recent.unproven.items() for time_ns in times_ns]

    def prove(self, pump: int, time_ns: int, *, is_heard: bool) -> None:
        """Know from now on whether such a verdict was heard."""
        self._recent.unproven[pump].remove(time_ns)
        self._counts["unheard"] += not is_heard

    def figures(self) -> dict[str, float]:
        """Health figures."""
        counts = {name: float(count) for name, count in (self.detector.counts | self._counts).items()}
        age_s = time.monotonic() - self._heard_s
        return counts | {"sample_age_s": age_s, "audit_errors": float(self._audit.errors)}

    def decoded(self, payload: bytes, kind: type[SampleMessage]) -> SampleMessage | None:
        """Message of this station in a payload; one that is none is counted, and None."""
        message = decoded(kind, payload, self._counts, log, self._place)
        if message is None:
            return None
        if message.station != self.station:
            self._counts["foreign"] += 1
            return None
        self._heard_s = time.monotonic()
        return message

    def _judge_block(self, message: SampleBlock) -> None:
        self._heard = message.time[-1], message.seq[-1]
        block = Block(
            time_ns=np.array(message.time, dtype=np.int64),
            seq=np.array(message.seq, dtype=np.int64),
            values=message.values(len(self._publishers)),
            is_switched=np.zeros((len(message.time), len(self._publishers)), dtype=bool),
            is_confirmed=np.zeros(len(message.time), dtype=bool),
            pumps=len(message.pumps),
            is_bad=message.quality == "bad",
        )
        verdicts, rest = list[Verdict](), list[Sample]()
        try:
            for verdict in self.detector.verdicts_on(block):
                verdicts.append(verdict)
        except Exception:  # one odd run must not take the station off
            self._counts["failures"] += 1
            log.exception("station '%s': samples from %d on could not be judged", self.station, message.seq[0])
            rest = behind(self.detector.last_heard, message.samples())
        for verdict in verdicts:
            self._publish(verdict)
        for sample in rest:
            self._judge(sample)

    def _judge(self, sample: Sample) -> None:
        self._heard = sample.time, sample.seq
        try:
            verdicts = self.detector.update(sample)
        except Exception:  # one odd run must not take the station off
            self._counts["failures"] += 1
            log.exception("station '%s': sample %d could not be judged", self.station, sample.seq)
            return
        for verdict in verdicts:
            self._publish(verdict)

    def handle_order(self, payload: bytes) -> None:
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
        self._audit.note(now_ns(), **order.model_dump(mode="json", exclude={"schema_name", "time"}))
        act = self.detector.rebaseline if order.act == "rebaseline" else self.detector.revert
        verdict = act(order.pump - 1, order.time)
        log.info("station '%s' pump %d: %s by %s", self.station, order.pump, order.act, order.by)
        evidence = verdict.evidence | {"order": order.id, "by": order.by}
        self._answers[order.id] = verdict.model_copy(update={"evidence": evidence})
        if len(self._answers) > ORDERS:
            self._answers.popitem(last=False)
        self.keep()  # what was answered must be true after a kill
        self._publish(self._answers[order.id])

    def handle_maintenance(self, payload: bytes) -> None:
        """Enter an act of a crew, once; one that is none is counted and left out."""
        try:
            act = MaintenanceAct.decode(payload)
        except MessageError as error:
            self._counts["malformed_acts"] += 1
            log.warning("station '%s': %s", self.station, error)
            return
        if act.station != self.station:
            self._counts["foreign_acts"] += 1
            log.warning("station '%s': act on station '%s' refused", self.station, act.station)
            return
        if act.id not in self._maintenance.records:
            fields = act.model_dump(mode="json", exclude={"schema_name", "time", "act"})
            self._audit.note(now_ns(), act="maintenance", done=act.act, at=act.time and to_iso(act.time), **fields)
        for verdict in self._maintenance.enter(act):
            self._publish(verdict)
        self.keep()  # what was entered must be known after a kill

    def _publish_act(self, record: MaintenanceRecord) -> None:
        log.info("station '%s': %s %s by %s: %s", self.station, record.asset, record.act, record.by, record.result)
        self._acts_publisher.put(record.encode())

    def _tell_again(self, payloads: Sequence[bytes]) -> None:
        """Tell what was told before, in its order: nobody may have heard it. Curves are those of the last ones."""
        verdicts = [Verdict.decode(payload) for payload in payloads]
        last = {verdict.pump: verdict for verdict in verdicts}
        for verdict in verdicts:
            tell = self._publish if verdict is last[verdict.pump] else self._tell
            tell(verdict)

    def _publish(self, verdict: Verdict) -> None:
        self._tell(verdict)
        self._model.update(verdict)

    def _tell(self, verdict: Verdict) -> None:
        self._counts["verdicts"] += 1
        payload = verdict.encode()
        self._publishers[verdict.pump - 1].put(payload)
        self._recent.add(verdict, payload)
        if self._states.get(verdict.pump) != verdict.state:
            log.info("station '%s' pump %d: %s", self.station, verdict.pump, verdict.state)
        self._states[verdict.pump] = verdict.state
        self._maintenance.follow(verdict)


def behind(last: tuple[int, int], samples: list[Sample]) -> list[Sample]:
    """Those behind the sample of this time and number; all if it is not among them.

    The detector takes a long row of samples that it has had for a clock that was set back.
    """
    for place in range(len(samples), 0, -1):
        if (samples[place - 1].time, samples[place - 1].seq) == last:
            return samples[place:]
    return samples
