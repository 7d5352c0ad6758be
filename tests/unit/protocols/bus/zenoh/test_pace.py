"""How fast a bus declares its keys, with a router that answers when it is told to."""

from types import SimpleNamespace

import pytest
import zenoh

from wetwell.protocols.bus.zenoh import pace as module
from wetwell.protocols.bus.zenoh.pace import MOST_OPEN, Pace


class Answer:
    def __init__(self):
        self.has_come = False

    def try_recv(self):
        if self.has_come:
            raise zenoh.ZError("disconnected")


class Session:
    def __init__(self):
        self.asked = []

    def liveliness(self):
        return SimpleNamespace(get=self._get)

    def _get(self, *_, **__):
        self.asked.append(Answer())
        return self.asked[-1]


def test_the_router_is_asked_once_it_may_be_behind_and_not_again_before_it_answers():
    session, pace = Session(), Pace()
    pace.count(session, MOST_OPEN - 1)
    assert not session.asked
    assert not pace.is_behind
    pace.count(session, 1)
    pace.count(session, MOST_OPEN)
    assert len(session.asked) == 1
    assert pace.is_behind
    session.asked[0].has_come = True
    assert not pace.is_behind
    pace.count(session, 1)
    assert len(session.asked) == 2, "what was declared meanwhile counts"


def test_who_waits_goes_on_when_it_has_answered(monkeypatch):
    session, pace, slept = Session(), Pace(), []

    def sleep(seconds):
        slept.append(seconds)
        session.asked[0].has_come = len(slept) == 3

    monkeypatch.setattr(module.time, "sleep", sleep)
    pace.wait()
    assert not slept
    pace.count(session, MOST_OPEN)
    pace.wait()
    assert len(slept) == 3


@pytest.mark.parametrize("declarations", [1, 7, MOST_OPEN, 3 * MOST_OPEN])
def test_no_more_are_open_than_twice_as_many(declarations):
    session, pace, made = Session(), Pace(), 0
    while not pace.is_behind:
        pace.count(session, declarations)
        made += declarations
    assert made <= max(2 * MOST_OPEN, declarations)
