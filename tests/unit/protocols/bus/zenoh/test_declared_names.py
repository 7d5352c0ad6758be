"""Numbers of keys: each key once, and none beyond those that Zenoh can tell apart."""

import pytest

from wetwell.protocols.bus.zenoh import declared_names
from wetwell.protocols.bus.zenoh.declared_names import DeclaredNames


class Session:
    def __init__(self):
        self.declared: list[str] = []

    def declare_keyexpr(self, key):
        self.declared.append(key)
        return key


@pytest.fixture
def session() -> Session:
    return Session()


def test_a_key_is_declared_once_and_one_of_a_subscription_never(session):
    names = DeclaredNames(session)
    names.note("wetwell/alpha/sample")
    for key in ("wetwell/alpha/sample", "wetwell/beta/sample", "wetwell/beta/sample"):
        names.add(key)
    assert session.declared == ["wetwell/beta/sample"]


def test_publishers_and_keys_that_were_heard_share_the_numbers(session, monkeypatch):
    monkeypatch.setattr(declared_names, "MOST_NUMBERS", 5)
    names = DeclaredNames(session)
    assert [names.take() for _ in range(3)] == [True] * 3
    for number in range(10):
        names.add(f"wetwell/s{number}/sample")
    assert len(session.declared) == 2
    assert not names.take()
