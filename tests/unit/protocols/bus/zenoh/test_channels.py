"""Channels that are looked into when their next message is due: nothing is left behind, empty ones cost little."""

from collections import deque
from itertools import pairwise

import pytest

from wetwell.protocols.bus.zenoh.channels import EARLY, FEW, LONGEST_REST_S, QUIET_REST_S, SLOT_S, Channels

TICK_S = 0.005
MANY = FEW + 1


class Feed:
    """One channel: what is in it, and how often it was looked into."""

    def __init__(self) -> None:
        self.waiting: deque[tuple[float, int]] = deque()
        self.looks = 0

    def receive(self):
        self.looks += 1
        return self.waiting.popleft() if self.waiting else None


@pytest.fixture
def feeds() -> list[Feed]:
    return [Feed() for _ in range(MANY)]


def played(feeds, channels, arrivals_s: list[float], until_s: float) -> list[tuple[float, int, float]]:
    """What the last feed had: when it came, its number, and when it was taken. The others stay empty."""
    coming, taken = deque(enumerate(arrivals_s)), []
    for tick in range(round(until_s / TICK_S)):
        now_s = 1000.0 + tick * TICK_S
        while coming and 1000.0 + coming[0][1] <= now_s:
            number, arrival_s = coming.popleft()
            feeds[-1].waiting.append((1000.0 + arrival_s, number))
        taken += [(arrival_s, number, now_s) for arrival_s, number in channels.messages(now_s)]
    return taken


@pytest.mark.parametrize("pause_s", [0.01, 0.3, 1.0, 3.0])
def test_a_feed_with_a_rhythm_is_heard_in_time_with_few_looks(feeds, pause_s):
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    arrivals_s = [pause_s * number for number in range(1, 1 + int(30.0 / pause_s))]
    taken = played(feeds, channels, arrivals_s, 31.0)
    assert [number for _, number, _ in taken] == list(range(len(arrivals_s)))
    in_rhythm = [one for one in taken if one[0] > 1001.0 + 2.0 * pause_s]
    assert max(now_s - arrival_s for arrival_s, _, now_s in in_rhythm) <= TICK_S + EARLY * TICK_S + 1e-9
    ticks = 31.0 / TICK_S
    assert feeds[0].looks < 2 * ticks * TICK_S / QUIET_REST_S
    if pause_s == 1.0:
        assert feeds[-1].looks < (1.0 - EARLY + 0.25) * ticks


def test_whatever_comes_and_whenever_all_of_it_is_taken_in_order(feeds):
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    arrivals_s = sorted(
        [0.3, 1.3, 1.35, 2.9, 2.9, 2.9, 9.0, 9.001, 9.9, 10.0, *(10.0 + 0.003 * n for n in range(400))]
    )
    taken = played(feeds, channels, arrivals_s, 20.0)
    assert [number for _, number, _ in taken] == list(range(len(arrivals_s)))
    late_s = [now_s - arrival_s for arrival_s, _, now_s in taken]
    assert max(late_s) <= LONGEST_REST_S + SLOT_S + TICK_S
    assert all(before <= after for (*_, before), (*_, after) in pairwise(taken))


@pytest.mark.parametrize(("number", "has_rhythm"), [(FEW, True), (MANY, False)])
def test_few_channels_and_those_of_many_publishers_are_looked_into_each_time(number, has_rhythm):
    feeds = [Feed() for _ in range(number)]
    channels = Channels([feed.receive for feed in feeds], has_rhythm=has_rhythm)
    taken = played(feeds, channels, [0.5, 1.0, 3.0, 9.0, 9.1], 10.0)
    assert max(now_s - arrival_s for arrival_s, _, now_s in taken) <= TICK_S + 1e-9


def test_a_reader_that_fails_at_a_message_loses_no_channel(feeds):
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    list(channels.messages(1000.0))
    for feed in feeds:
        feed.waiting.append((0.0, 0))
    taken = []

    def take(now_s: float) -> None:
        for sample in channels.messages(now_s):
            taken.append(sample)
            if len(taken) == 3:
                raise ValueError("odd")

    with pytest.raises(ValueError, match="odd"):
        take(1001.0)
    take(1001.0 + TICK_S)
    assert len(taken) == MANY
