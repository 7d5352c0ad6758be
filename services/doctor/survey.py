"""What a site shows to a client that listens to it for a few seconds."""

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from wetwell.protocols.bus.interface import Bus, Presence, Subscription
from wetwell.protocols.bus.keys import (
    SITE,
    alarm_report_key,
    alive_key,
    history_key,
    sample_block_key,
    sample_key,
    status_key,
    verdict_key,
)
from wetwell.protocols.messages.alarm import AlarmReport
from wetwell.protocols.messages.decoding import M, SampleMessage, samples_of
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.runtime.clock import now_ns

T = TypeVar("T")

SURVEY_ANSWER_S = 3.0
HOUR_NS = 3600 * NS_PER_S


@dataclass
class Survey:
    """What was heard, by station.

    `samples` are with the time of day at which each came, the same for all of a message; `gathered` those of the last
    message that a station which gathers them had sent before, with the time of day at which it was asked for.
    """

    seconds: float
    samples: dict[str, list[tuple[int, Sample]]] = field(default_factory=dict)
    gathered: dict[str, list[tuple[int, Sample]]] = field(default_factory=dict)
    verdicts: dict[tuple[str, int], Verdict] = field(default_factory=dict)
    statuses: dict[tuple[str, str], Status] = field(default_factory=dict)
    alive: set[tuple[str, str]] = field(default_factory=set)
    histories: dict[str, History] = field(default_factory=dict)
    report: AlarmReport | None = None

    @property
    def stations(self) -> set[str]:
        """Stations of which anything was heard."""
        others = (station for station, _ in [*self.alive, *self.statuses, *self.verdicts])
        return {*self.samples, *self.gathered, *others} - {SITE}

    def last_sample(self, station: str) -> Sample | None:
        """Its newest sample; None if there is none."""
        heard = self.samples.get(station) or self.gathered.get(station)
        return heard[-1][1] if heard else None


async def listen(bus: Bus, seconds: float) -> Survey:
    """Listen to a site for so long, then ask historian and alarms."""
    survey = Survey(seconds)

    def handle_samples(message: SampleMessage) -> None:
        survey.samples.setdefault(message.station, []).extend(_with_time(message, now_ns()))

    def handle_gathered(block: SampleBlock) -> None:
        survey.gathered[block.station] = _with_time(block, asked_ns)

    def handle_verdict(verdict: Verdict) -> None:
        last = survey.verdicts.get((verdict.station, verdict.pump))
        if last is None or verdict.time >= last.time:
            survey.verdicts[verdict.station, verdict.pump] = verdict

    def handle_status(status: Status) -> None:
        survey.statuses[status.station, status.service] = status

    def handle_presence(presence: Presence) -> None:
        _, station, _, service = presence.key.split("/", 3)
        (survey.alive.add if presence.is_alive else survey.alive.discard)((station, service))

    tasks = [
        asyncio.create_task(_each(bus.subscribe(sample_key("*")), _decoding(Sample, handle_samples))),
        asyncio.create_task(_each(bus.subscribe(sample_block_key("*")), _decoding(SampleBlock, handle_samples))),
        asyncio.create_task(_each(bus.subscribe(verdict_key("*"), history=1), _decoding(Verdict, handle_verdict))),
        asyncio.create_task(_each(bus.subscribe(status_key("*", "*"), history=1), _decoding(Status, handle_status))),
        asyncio.create_task(_each(bus.watch(alive_key("*", "*")), handle_presence)),
    ]
    asked_ns = now_ns()
    asking = asyncio.create_task(bus.ask(sample_block_key("*"), timeout_s=SURVEY_ANSWER_S))
    await asyncio.sleep(seconds)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    for payload in await asking:
        _decoding(SampleBlock, handle_gathered)(payload)
    await _ask(bus, survey)
    return survey


async def _ask(bus: Bus, survey: Survey) -> None:
    survey.report = _first(AlarmReport, await bus.ask(alarm_report_key(), timeout_s=SURVEY_ANSWER_S))
    for station in sorted(survey.stations):
        last = survey.last_sample(station)
        last_ns = now_ns() if last is None else last.time
        query = HistoryQuery(kind="samples", start=last_ns - HOUR_NS, end=last_ns, points=10)
        history = _first(History, await bus.ask(history_key(station), query.encode(), timeout_s=SURVEY_ANSWER_S))
        if history is not None:
            survey.histories[station] = history


async def _each(subscription: Subscription[T], handle: Callable[[T], None]) -> None:
    while True:
        for message in await subscription.receive():
            handle(message)


def _with_time(message: SampleMessage, heard_ns: int) -> list[tuple[int, Sample]]:
    return [(heard_ns, sample) for sample in samples_of(message)]


def _decoding(message: type[M], handle: Callable[[M], None]) -> Callable[[bytes], None]:
    def decode(payload: bytes) -> None:
        with contextlib.suppress(MessageError):  # the daemons count what is no message
            handle(message.decode(payload))

    return decode


def _first(message: type[M], payloads: list[bytes]) -> M | None:
    for payload in payloads:
        with contextlib.suppress(MessageError):
            return message.decode(payload)
    return None
