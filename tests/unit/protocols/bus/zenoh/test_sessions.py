"""Sessions of a bus: a further one when the last has no room, and what happens where none can be opened."""

from types import SimpleNamespace

import pytest
import zenoh

from wetwell.protocols.bus.zenoh import sessions as module
from wetwell.protocols.bus.zenoh.pace import Pace
from wetwell.protocols.bus.zenoh.sessions import ROOM_OF_FIRST, ROOM_OF_FURTHER, Line, Sessions
from wetwell.protocols.errors import LinkError


class Taken:
    def try_recv(self):
        raise zenoh.ZError("disconnected")


class Session:
    def __init__(self):
        self.declared: list[str] = []
        self.is_open = True
        self.routers = ["a router"]
        self.info = SimpleNamespace(
            declare_transport_events_listener=lambda *_, **__: None, routers_zid=lambda: self.routers
        )

    def declare_keyexpr(self, key):
        self.declared.append(key)
        return zenoh.KeyExpr(key)

    def liveliness(self):
        return SimpleNamespace(get=lambda *_, **__: Taken())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.is_open = False
        raise zenoh.ZError("close operation timed out!")


def away():
    raise LinkError("the router is away")


def test_a_full_session_has_a_further_one_beside_it():
    sessions = Sessions(Session(), Session)
    first = {sessions.with_room(1) for _ in range(ROOM_OF_FIRST)}
    second = {sessions.with_room(1) for _ in range(ROOM_OF_FURTHER)}
    assert first == {sessions.first}
    assert len(second) == 1
    assert sessions.with_room(1) not in first | second


def test_what_belongs_together_is_in_one_session():
    sessions = Sessions(Session(), Session)
    sessions.with_room(ROOM_OF_FIRST - 1)
    assert sessions.with_room(3) is not sessions.first


@pytest.mark.parametrize("further", [None, away])
def test_where_there_can_be_no_other_the_first_takes_all(further):
    sessions = Sessions(Session(), further)
    assert {sessions.with_room(1) for _ in range(ROOM_OF_FIRST + 1)} == {sessions.first}
    assert sessions.apart() is sessions.first.session


def test_nobody_waits_for_another_session_while_the_router_is_away():
    sessions = Sessions(Session(), lambda: pytest.fail("it would be waited for"))
    sessions.first.session.routers = []
    assert sessions.with_room(ROOM_OF_FIRST + 1) is sessions.first
    assert sessions.apart() is sessions.first.session


def test_who_lives_is_asked_in_a_session_apart():
    sessions = Sessions(Session(), Session)
    assert sessions.apart() not in [line.session for line in sessions.lines]


def test_a_session_whose_end_nobody_hears_of_keeps_no_other_open():
    sessions = Sessions(Session(), Session)
    sessions.with_room(ROOM_OF_FIRST)
    sessions.with_room(1)
    opened = [*(line.session for line in sessions.lines), sessions.apart()]
    sessions.close()
    assert [session.is_open for session in opened] == [False] * 3


def test_no_more_keys_are_declared_than_zenoh_can_tell_apart(monkeypatch):
    monkeypatch.setattr(module, "MOST_NUMBERS", 2)
    line = Line(Session(), ROOM_OF_FIRST, Pace())
    keys = [f"wetwell/s{number}/sample" for number in range(3)]
    assert [str(line.numbered(key)) for key in keys] == keys
    assert line.session.declared == keys[:2]
