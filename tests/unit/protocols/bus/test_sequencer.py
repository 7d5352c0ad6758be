import random
from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.protocols.bus import publisher_cache
from wetwell.protocols.bus import sequencer as sequencer_module
from wetwell.protocols.bus.publisher_cache import PAGE_BYTES, CacheQuery, Page, PublisherCache, read_sequence_header
from wetwell.protocols.bus.sequencer import MOST_HELD, MOST_STREAMS, Sequencer

KEY = "wetwell/alpha/sample"


def passed_on(sequencer: Sequencer) -> list[bytes]:
    payloads = [payload for _, payload in sequencer.ready]
    sequencer.ready.clear()
    return payloads


def ask_for_all(sequencer: Sequencer, kept: dict[str, PublisherCache], *, answers: bool = True) -> None:
    """Ask what is wanted until nothing is; who does not answer is given up."""
    while sequencer.wanted:
        _, stream = sequencer.wanted.popitem()
        page = kept[stream.key].page(CacheQuery(source=stream.source.hex(), begin=stream.next)) if answers else None
        if page is None:
            sequencer.give_up(stream)
        else:
            sequencer.handle_page(stream.key, Page.decode(*page.encode()), is_from_next=True)


@pytest.mark.parametrize("seed", range(30))
def test_lost_doubled_and_reordered_messages_come_once_and_in_order(seed):
    dice = random.Random(seed)
    kept = {f"wetwell/s{number}/sample": PublisherCache(300) for number in range(3)}
    sequencer, got = Sequencer(300), dict.fromkeys(kept, b"")
    on_the_way: list[tuple[str, bytes, bytes]] = []
    for number in range(300):
        for key, publisher in kept.items():
            payload = b"%d " % number
            header = publisher.add(payload)
            if dice.random() < 0.8:
                on_the_way += [(key, header, payload)] * dice.choice((1, 1, 2))
        if dice.random() < 0.5:
            dice.shuffle(on_the_way)
            while on_the_way:
                sequencer.handle_message(*on_the_way.pop())
            if dice.random() < 0.3:
                ask_for_all(sequencer, kept)
    for key, publisher in kept.items():
        sequencer.handle_tail(key, publisher.next_header)
    ask_for_all(sequencer, kept)
    for key, payload in sequencer.ready:
        got[key] += payload
    assert set(got.values()) == {b"".join(b"%d " % number for number in range(300))}
    assert sequencer.lost == 0


def test_what_nobody_keeps_is_given_up_counted_and_the_rest_passed_on_in_order():
    publisher, sequencer = PublisherCache(5), Sequencer(0)
    headers = [publisher.add(b"%d" % number) for number in range(20)]
    for number in (3, 6, 4, 19):
        sequencer.handle_message(KEY, headers[number], b"%d" % number)
    assert passed_on(sequencer) == [b"3", b"4"]
    ask_for_all(sequencer, {KEY: publisher})
    assert passed_on(sequencer) == [b"6", *(b"%d" % number for number in range(15, 20))]
    assert sequencer.lost == 1 + 8
    sequencer.handle_message(KEY, headers[5], b"5")
    assert passed_on(sequencer) == []


def test_without_an_answer_the_messages_that_wait_are_passed_on():
    publisher, sequencer = PublisherCache(50), Sequencer(0)
    headers = [publisher.add(b"%d" % number) for number in range(9)]
    for number in (0, 2, 5):
        sequencer.handle_message(KEY, headers[number], b"%d" % number)
    ask_for_all(sequencer, {KEY: publisher}, answers=False)
    assert passed_on(sequencer) == [b"0", b"2", b"5"]
    assert sequencer.lost == 3


@pytest.mark.parametrize(("history", "first"), [(0, 7), (3, 4), (100, 2)])
def test_a_late_joiner_begins_with_its_history(history, first):
    publisher, sequencer = PublisherCache(6), Sequencer(history)
    for number in range(7):
        publisher.add(b"%d" % number)
    sequencer.handle_message(KEY, publisher.add(b"7"), b"7")
    ask_for_all(sequencer, {KEY: publisher})
    assert passed_on(sequencer) == [b"%d" % number for number in range(first, 8)]
    assert sequencer.lost == 0


def test_a_tail_alone_shows_what_was_lost():
    publisher, sequencer = PublisherCache(6), Sequencer(0)
    sequencer.handle_message(KEY, publisher.add(b"0"), b"0")
    publisher.add(b"1")
    sequencer.handle_tail(KEY, publisher.next_header)
    ask_for_all(sequencer, {KEY: publisher})
    assert passed_on(sequencer) == [b"0", b"1"]


def test_lives_of_publishers_do_not_pile_up_and_lose_nothing_that_has_come():
    sequencer, want = Sequencer(10), []
    for life in range(50 * MOST_STREAMS):
        publisher = PublisherCache(1)
        publisher.add(b"lost")
        sequencer.handle_message(KEY, publisher.add(b"%d" % life), b"%d" % life)
        want.append(b"%d" % life)
    assert len(sequencer.wanted) == MOST_STREAMS
    ask_for_all(sequencer, {KEY: publisher}, answers=False)
    assert sorted(passed_on(sequencer)) == sorted(want)


def test_messages_that_wait_do_not_pile_up():
    publisher, sequencer = PublisherCache(1), Sequencer(0)
    sequencer.handle_message(KEY, publisher.add(b"0"), b"0")
    publisher.add(b"lost")
    for _ in range(MOST_HELD + 5):
        sequencer.handle_message(KEY, publisher.add(b"x"), b"x")
    assert passed_on(sequencer) == [b"0"]
    (stream,) = sequencer.wanted.values()
    assert len(stream.held) == MOST_HELD
    sequencer.give_up(stream)
    assert len(passed_on(sequencer)) == MOST_HELD
    assert sequencer.lost == 1
    assert stream.is_missing, "what was let go for want of room is asked for"


@given(gaps=st.sets(st.integers(1, 60)), most_bytes=st.integers(1, 200))
def test_what_was_let_go_for_want_of_room_comes_from_the_publisher(gaps, most_bytes):
    publisher, sequencer = PublisherCache(100), Sequencer(0)
    want = [b"%d" % number for number in range(64)]
    with mock.patch.object(sequencer_module, "MOST_HELD_BYTES", most_bytes):
        for number, payload in enumerate(want):
            header = publisher.add(payload)
            if number in gaps and number % 2:
                assert sequencer.let_go(KEY, header)
            elif number not in gaps:
                sequencer.handle_message(KEY, header, payload)
        sequencer.handle_tail(KEY, publisher.next_header)
        ask_for_all(sequencer, {KEY: publisher})
    assert passed_on(sequencer) == want
    assert sequencer.lost == 0
    assert sequencer._held_bytes == 0


def test_a_message_without_a_mark_is_passed_on_at_once():
    sequencer = Sequencer(0)
    for header in (None, b"", b"of another program"):
        sequencer.handle_message(KEY, header, b"x")
    sequencer.handle_tail(KEY, b"?")
    assert passed_on(sequencer) == [b"x"] * 3


def test_an_answer_has_bounded_size_and_at_least_one_message():
    kept = PublisherCache(10)
    assert kept.page(CacheQuery()) is None
    for size in (10, PAGE_BYTES, 10, 10):
        kept.add(b"x" * size)
    sizes = [
        [len(payload) for payload in kept.page(CacheQuery(source=kept.source.hex(), begin=begin)).payloads]
        for begin in (0, 1, 2, 4, 99)
    ]
    assert sizes == [[10], [PAGE_BYTES], [10, 10], [], []]
    assert kept.page(CacheQuery(source="00" * 8)) is None
    assert read_sequence_header(kept.next_header) == (kept.source, 4)


def test_what_a_publisher_keeps_has_a_bound_in_bytes_whatever_its_history():
    with mock.patch.object(publisher_cache, "KEPT_BYTES", 25):
        kept = PublisherCache(1_000)
        for number in range(10):
            kept.add(b"%010d" % number)
        page = kept.page(CacheQuery(source=kept.source.hex(), begin=0))
        assert (page.first, page.end, len(page.payloads)) == (8, 10, 2)
        kept.add(b"x" * 1_000)
        assert kept.last == b"x" * 1_000, "the last one is always kept"


@pytest.mark.parametrize("damage", [slice(-1), slice(-4), slice(0)])
def test_a_damaged_answer_is_none(damage):
    kept = PublisherCache(3)
    kept.add(b"one")
    body, head = kept.page(CacheQuery()).encode()
    assert Page.decode(body, head[damage]) is None
    assert Page.decode(body, head + b"1234") is None
