import random

import pytest

from wetwell.protocols.bus.publisher_cache import PAGE_BYTES, KeptMessages, KeptQuery, Page, read_mark
from wetwell.protocols.bus.sequencer import LINES, MOST_HELD, Sequencer

KEY = "wetwell/alpha/sample"


def passed_on(follower: Sequencer) -> list[bytes]:
    payloads = [payload for _, payload in follower.ready]
    follower.ready.clear()
    return payloads


def ask_for_all(follower: Sequencer, kept: dict[str, KeptMessages], *, answers: bool = True) -> None:
    """Ask what is wanted until nothing is; who does not answer is given up."""
    while follower.wanted:
        _, line = follower.wanted.popitem()
        page = kept[line.key].page(KeptQuery(source=line.source.hex(), begin=line.next)) if answers else None
        if page is None:
            follower.give_up(line)
        else:
            follower.take_page(line.key, Page.decode(*page.encode()), is_from_next=True)


@pytest.mark.parametrize("seed", range(30))
def test_lost_doubled_and_reordered_messages_come_once_and_in_order(seed):
    dice = random.Random(seed)
    kept = {f"wetwell/s{number}/sample": KeptMessages(300) for number in range(3)}
    follower, got = Sequencer(300), dict.fromkeys(kept, b"")
    on_the_way: list[tuple[str, bytes, bytes]] = []
    for number in range(300):
        for key, publisher in kept.items():
            payload = b"%d " % number
            mark = publisher.add(payload)
            if dice.random() < 0.8:
                on_the_way += [(key, mark, payload)] * dice.choice((1, 1, 2))
        if dice.random() < 0.5:
            dice.shuffle(on_the_way)
            while on_the_way:
                follower.take(*on_the_way.pop())
            if dice.random() < 0.3:
                ask_for_all(follower, kept)
    for key, publisher in kept.items():
        follower.take_tail(key, publisher.next_mark)
    ask_for_all(follower, kept)
    for key, payload in follower.ready:
        got[key] += payload
    assert set(got.values()) == {b"".join(b"%d " % number for number in range(300))}
    assert follower.lost == 0


def test_what_nobody_keeps_is_given_up_counted_and_the_rest_passed_on_in_order():
    publisher, follower = KeptMessages(5), Sequencer(0)
    marks = [publisher.add(b"%d" % number) for number in range(20)]
    for number in (3, 6, 4, 19):
        follower.take(KEY, marks[number], b"%d" % number)
    assert passed_on(follower) == [b"3", b"4"]
    ask_for_all(follower, {KEY: publisher})
    assert passed_on(follower) == [b"6", *(b"%d" % number for number in range(15, 20))]
    assert follower.lost == 1 + 8
    follower.take(KEY, marks[5], b"5")
    assert passed_on(follower) == []


def test_without_an_answer_the_messages_that_wait_are_passed_on():
    publisher, follower = KeptMessages(50), Sequencer(0)
    marks = [publisher.add(b"%d" % number) for number in range(9)]
    for number in (0, 2, 5):
        follower.take(KEY, marks[number], b"%d" % number)
    ask_for_all(follower, {KEY: publisher}, answers=False)
    assert passed_on(follower) == [b"0", b"2", b"5"]
    assert follower.lost == 3


@pytest.mark.parametrize(("history", "first"), [(0, 7), (3, 4), (100, 2)])
def test_a_late_joiner_begins_with_its_history(history, first):
    publisher, follower = KeptMessages(6), Sequencer(history)
    for number in range(7):
        publisher.add(b"%d" % number)
    follower.take(KEY, publisher.add(b"7"), b"7")
    ask_for_all(follower, {KEY: publisher})
    assert passed_on(follower) == [b"%d" % number for number in range(first, 8)]
    assert follower.lost == 0


def test_a_tail_alone_shows_what_was_lost():
    publisher, follower = KeptMessages(6), Sequencer(0)
    follower.take(KEY, publisher.add(b"0"), b"0")
    publisher.add(b"1")
    follower.take_tail(KEY, publisher.next_mark)
    ask_for_all(follower, {KEY: publisher})
    assert passed_on(follower) == [b"0", b"1"]


def test_lives_of_publishers_do_not_pile_up_and_lose_nothing_that_has_come():
    follower, want = Sequencer(10), []
    for life in range(50 * LINES):
        publisher = KeptMessages(1)
        publisher.add(b"lost")
        follower.take(KEY, publisher.add(b"%d" % life), b"%d" % life)
        want.append(b"%d" % life)
    assert len(follower.wanted) == LINES
    ask_for_all(follower, {KEY: publisher}, answers=False)
    assert sorted(passed_on(follower)) == sorted(want)


def test_messages_that_wait_do_not_pile_up():
    publisher, follower = KeptMessages(1), Sequencer(0)
    follower.take(KEY, publisher.add(b"0"), b"0")
    publisher.add(b"lost")
    for _ in range(MOST_HELD + 1):
        follower.take(KEY, publisher.add(b"x"), b"x")
    assert len(passed_on(follower)) == MOST_HELD + 2
    assert (follower.lost, follower.wanted) == (1, {})


def test_a_message_without_a_mark_is_passed_on_at_once():
    follower = Sequencer(0)
    for mark in (None, b"", b"of another program"):
        follower.take(KEY, mark, b"x")
    follower.take_tail(KEY, b"?")
    assert passed_on(follower) == [b"x"] * 3


def test_an_answer_has_bounded_size_and_at_least_one_message():
    kept = KeptMessages(10)
    assert kept.page(KeptQuery()) is None
    for size in (10, PAGE_BYTES, 10, 10):
        kept.add(b"x" * size)
    sizes = [
        [len(payload) for payload in kept.page(KeptQuery(source=kept.source.hex(), begin=begin)).payloads]
        for begin in (0, 1, 2, 4, 99)
    ]
    assert sizes == [[10], [PAGE_BYTES], [10, 10], [], []]
    assert kept.page(KeptQuery(source="00" * 8)) is None
    assert read_mark(kept.next_mark) == (kept.source, 4)


@pytest.mark.parametrize("damage", [slice(-1), slice(-4), slice(0)])
def test_a_damaged_answer_is_none(damage):
    kept = KeptMessages(3)
    kept.add(b"one")
    body, head = kept.page(KeptQuery()).encode()
    assert Page.decode(body, head[damage]) is None
    assert Page.decode(body, head + b"1234") is None
