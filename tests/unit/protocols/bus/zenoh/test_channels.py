"""Channels that are looked into when their next message is due: nothing is left behind, empty ones cost little."""

from collections import deque
from itertools import pairwise

import pytest

from wetwell.protocols.bus.zenoh.channels import (
    EARLY,
    EARLY_S,
    FEW,
    LONGEST_REST_S,
    QUIET_REST_S,
    QUIET_S,
    SLOT_S,
    STIRRED_S,
    Channels,
)

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


def played(
    feeds, channels, arrivals_s: list[float], until_s: float, away_s=(0.0, 0.0)
) -> list[tuple[float, int, float]]:
    """What the last feed had: when it came, its number, and when it was taken. The others stay empty.

    Between the times `away_s` the process stands still.
    """
    coming, taken = deque(enumerate(arrivals_s)), []
    for tick in range(round(until_s / TICK_S)):
        now_s = 1000.0 + tick * TICK_S
        while coming and 1000.0 + coming[0][1] <= now_s:
            number, arrival_s = coming.popleft()
            feeds[-1].waiting.append((1000.0 + arrival_s, number))
        if away_s[0] < now_s - 1000.0 < away_s[1]:
            continue
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
    assert feeds[0].looks < 2 * ticks * TICK_S / QUIET_REST_S + STIRRED_S / TICK_S
    if pause_s == 1.0:
        assert feeds[-1].looks < (1.0 - EARLY + 0.25) * ticks


@pytest.mark.parametrize("pause_s", [10.0, 30.0])
def test_a_feed_of_gathered_samples_is_heard_in_time_and_wakes_nobody(feeds, pause_s):
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    arrivals_s = [pause_s * number for number in range(1, 11)]
    taken = played(feeds, channels, arrivals_s, 10 * pause_s + 1.0)
    assert [number for _, number, _ in taken] == list(range(10))
    waited_s = [now_s - arrival_s for arrival_s, _, now_s in taken]
    assert max(waited_s[:2]) <= QUIET_REST_S + TICK_S
    assert max(waited_s[2:]) <= TICK_S + 1e-9
    once_awake = (STIRRED_S + QUIET_S) / TICK_S
    each_time = (EARLY_S + SLOT_S) / TICK_S + pause_s / LONGEST_REST_S
    assert feeds[-1].looks < 2 * once_awake + 10 * each_time
    assert feeds[0].looks < once_awake + 10 * pause_s / QUIET_REST_S


@pytest.mark.parametrize("late_s", [0.1, 0.4, 0.9])
def test_what_comes_in_time_after_a_message_that_was_late_is_heard_at_once(feeds, late_s):
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    arrivals_s = [number + (late_s if number in {10, 15} else 0.0) for number in range(1, 20)]
    taken = played(feeds, channels, arrivals_s, 21.0)
    assert len(taken) == len(arrivals_s)
    assert max(now_s - arrival_s for arrival_s, _, now_s in taken[2:]) <= TICK_S + 1e-9


@pytest.mark.parametrize("stood_s", [0.4, 1.3, 2.95])
def test_what_comes_after_the_process_stood_still_is_heard_at_once(feeds, stood_s):
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    taken = played(feeds, channels, [float(number) for number in range(1, 20)], 20.0, (10.1, 10.1 + stood_s))
    assert len(taken) == 19
    assert all(
        now_s - arrival_s <= TICK_S + 1e-9 for arrival_s, _, now_s in taken[2:] if arrival_s > 1010.1 + stood_s
    )


def test_where_one_that_was_silent_speaks_the_others_are_heard_at_once_for_a_while(feeds):
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    waits_s = []
    for tick in range(round(40.0 / TICK_S)):
        now_s = 1000.0 + tick * TICK_S
        if tick % 20 == 0 and tick // 20 < MANY:  # one station each tenth of a second, then silence
            feeds[tick // 20].waiting.append((now_s, 0))
        waits_s += [now_s - came_s for came_s, _ in channels.messages(now_s)]
    assert len(waits_s) == MANY
    assert waits_s[0] <= QUIET_REST_S + TICK_S
    assert max(waits_s[1 : int(STIRRED_S / 0.1)]) <= TICK_S
    assert max(waits_s) <= QUIET_REST_S + TICK_S
    assert feeds[0].looks < 40.0 / QUIET_REST_S + 2 * (STIRRED_S + QUIET_S) / TICK_S


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


@pytest.mark.parametrize(("fast", "slow", "rate_hz"), [(80, 0, 1.0), (0, 80, 0.1), (40, 120, 41.2 / 52.0)])
def test_the_rate_of_all_is_that_of_their_messages(fast, slow, rate_hz):
    feeds = [Feed() for _ in range(fast + slow)]
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    for tick in range(6_000):
        for number, feed in enumerate(feeds):
            every = 20 if number < fast else 200  # a second, ten seconds
            if tick % every == number % every:
                feed.waiting.append((0.0, 0))
        list(channels.messages(1000.0 + 0.05 * tick))
    assert channels.rate_hz == pytest.approx(rate_hz, rel=0.2)


def test_few_have_no_rate():
    channels = Channels([Feed().receive for _ in range(FEW)], has_rhythm=True)
    list(channels.messages(1000.0))
    assert channels.rate_hz == float("inf")


def test_first_messages_make_nobody_slow():
    feeds = [Feed() for _ in range(MANY)]
    channels = Channels([feed.receive for feed in feeds], has_rhythm=True)
    for second in range(3):
        for feed in feeds:
            feed.waiting.append((0.0, 0))
        list(channels.messages(1000.0 + second))
        assert channels.rate_hz == pytest.approx(1.0)
