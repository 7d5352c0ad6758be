import asyncio

import pytest
from memory_bus import MemoryBus, matches


@pytest.mark.parametrize(
    ("expression", "key", "lies_in"),
    [
        ("wetwell/alpha/sample", "wetwell/alpha/sample", True),
        ("wetwell/alpha/sample", "wetwell/alpha", False),
        ("wetwell/alpha", "wetwell/alpha/sample", False),
        ("wetwell/*/sample", "wetwell/alpha/sample", True),
        ("wetwell/*/sample", "wetwell/alpha/verdict/1", False),
        ("wetwell/*", "wetwell/alpha/sample", False),
        ("wetwell/*", "wetwell", False),
        ("wetwell/al*", "wetwell/alpha", False),
        ("**", "wetwell/alpha/sample", True),
        ("wetwell/**", "wetwell", True),
        ("wetwell/**", "wetwell/alpha/verdict/1", True),
        ("wetwell/**/1", "wetwell/alpha/verdict/1", True),
        ("wetwell/**/1", "wetwell/alpha/verdict/2", False),
        ("**/*/sample", "wetwell/alpha/sample", True),
        ("**/alpha/**", "wetwell/beta/sample", False),
    ],
)
def test_key_expressions(expression, key, lies_in):
    assert matches(expression, key) is lies_in


def test_get_gives_the_last_message():
    bus = MemoryBus()
    publisher = bus.publisher("wetwell/alpha/verdict/1")
    assert bus.get("wetwell/alpha/verdict/1") is None
    publisher.put(b"old")
    publisher.put(b"new")
    assert bus.get("wetwell/alpha/verdict/1") == b"new"
    assert bus.get("wetwell/alpha/verdict/2") is None


def test_a_second_publisher_keeps_what_the_first_one_sent():
    bus = MemoryBus()
    first = bus.publisher("k", history=2)
    for payload in (b"1", b"2", b"3"):
        first.put(payload)
    bus.publisher("k", history=3).put(b"4")
    assert asyncio.run(bus.subscribe("k", history=10).receive()) == [b"2", b"3", b"4"]


def test_announced_keys_live_until_the_bus_is_closed():
    with MemoryBus() as bus:
        bus.announce("wetwell/alpha/alive/detector")
        assert bus.alive == {"wetwell/alpha/alive/detector"}
        assert bus.is_connected
    assert bus.alive == set()
