"""What is said of verdicts that nobody tells again."""

import asyncio
import logging

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import history_key
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.services.detector import unheard
from wetwell.services.detector.checkpoint import Told, checkpoint_in
from wetwell.services.detector.station_detector import StationDetector

TIME_NS = 86_400_000_000_000


def judge_of(alpha, folder, bus: MemoryBus) -> StationDetector:
    """One that goes on where a life before has given up a verdict of its second pump."""
    learning = StationDetector(bus, alpha)
    checkpoint_in(folder, "alpha").save(learning.detector, Told({}, given_up={2: [TIME_NS]}))
    return StationDetector(bus, alpha, checkpoint=checkpoint_in(folder, "alpha"))


async def said_with(bus: MemoryBus, judge: StationDetector, *answers: History) -> list[HistoryQuery]:
    """Questions to a historian that gives these answers, one after the other."""
    asked, questions = [], bus.answer(history_key("*"))
    saying = asyncio.create_task(unheard.say_unheard(bus, [judge]))
    left = list(answers)
    while left:
        for request in await questions.receive():
            asked.append(HistoryQuery.decode(request.payload))
            request.reply(left.pop(0).encode())
    await saying
    return asked


@pytest.mark.parametrize(("pump", "lost"), [(2, 0), (1, 1)])
def test_a_verdict_that_the_historian_does_not_have_is_said_to_be_lost(alpha, tmp_path, caplog, pump, lost):
    caplog.set_level(logging.WARNING)
    answer = History(station="alpha", kind="verdicts", messages=({"pump": pump},))
    with MemoryBus() as bus:
        judge = judge_of(alpha, tmp_path, bus)
        asked = asyncio.run(said_with(bus, judge, answer))
    assert [(query.kind, query.start, query.end) for query in asked] == [("verdicts", TIME_NS, TIME_NS + 1)]
    assert ("station 'alpha' pump 2: verdicts up to 1970-01-02" in caplog.text) == bool(lost)
    assert judge.figures()["unheard"] == lost
    judge.keep()
    assert checkpoint_in(tmp_path, "alpha").restore(judge.detector).given_up == {}


def test_a_historian_that_cannot_say_is_asked_again(alpha, tmp_path, monkeypatch):
    monkeypatch.setattr(unheard, "ASK_LATER_S", 0.0)
    cannot = History(station="alpha", kind="verdicts", error="database is locked")
    with MemoryBus() as bus:
        judge = judge_of(alpha, tmp_path, bus)
        asked = asyncio.run(said_with(bus, judge, cannot, History(station="alpha", kind="verdicts")))
    assert len(asked) == 2
    assert judge.unproven() == []


def test_until_somebody_has_said_it_stays_in_the_checkpoint(alpha, tmp_path):
    with MemoryBus() as bus:
        judge = judge_of(alpha, tmp_path, bus)
        judge.keep()
        assert StationDetector(bus, alpha, checkpoint=checkpoint_in(tmp_path, "alpha")).unproven() == [(2, TIME_NS)]
