"""The thread of a bus, driven by hand: what it does where nobody answers."""

from types import SimpleNamespace

import pytest
import zenoh

from wetwell.protocols.bus.mailbox import Mailbox
from wetwell.protocols.bus.publisher_cache import PublisherCache, read_query
from wetwell.protocols.bus.zenoh.sessions import Sessions
from wetwell.protocols.bus.zenoh.subscription import ZenohSubscription
from wetwell.protocols.bus.zenoh.worker import PERIOD_S, RecoveryQuery, ZenohWorker

KEY = "wetwell/alpha/sample"


class Replies:
    """Answers to one question: some, then the end, if it is not lost."""

    def __init__(self, answers, *, has_end):
        self._answers = answers
        self._has_end = has_end

    def try_recv(self):
        if self._answers:
            return self._answers.pop(0)
        if self._has_end:
            raise zenoh.ZError("all have answered")
        return None


class Session:
    """A network with publishers that are on the way, or behind a link that is away."""

    info = SimpleNamespace(routers_zid=lambda: ["a router"], declare_transport_events_listener=lambda *_, **__: None)

    def __init__(self):
        self.reached: list[PublisherCache] = []
        self.loses_ends = False
        self.asked: list[str] = []

    def declare_subscriber(self, *_):
        return SimpleNamespace(handler=SimpleNamespace(try_recv=lambda: None))

    def get(self, key, _channel, *, payload, **_):
        self.asked.append(key)
        answers = []
        for publisher in self.reached:
            page = publisher.page(read_query(payload))
            if page is not None:
                body, head = page.encode()
                answers.append(
                    SimpleNamespace(ok=SimpleNamespace(payload=Bytes(body), attachment=Bytes(head), key_expr=key))
                )
        return Replies(answers, has_end=not self.loses_ends)


class Bytes:
    def __init__(self, raw):
        self._raw = raw

    def to_bytes(self):
        return self._raw


class Bench:
    """A worker with one subscription, and a clock that is set."""

    def __init__(self):
        self.session = Session()
        self.got: list[bytes] = []
        sessions = Sessions(self.session)
        self.subscription = ZenohSubscription(
            sessions,
            [KEY],
            0,
            Mailbox(100),
            lambda ready: self.got.extend(each for _, each in ready),
            recover=True,
        )
        self.worker = ZenohWorker(sessions, is_router=False)
        self.worker._subscriptions.append(self.subscription)
        self.now_s = 100.0

    def hear(self, header: bytes, payload: bytes) -> None:
        self.subscription.sequencer.handle_message(KEY, header, payload)
        self.subscription.pass_on()

    def go_on(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            self.worker._handle_answers(self.now_s)
            self.worker._ask(self.now_s)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def headers(bench) -> list[bytes]:
    """Marks of ten messages, of which 0, 1 and 9 have been heard."""
    bench.publisher = PublisherCache(600)
    headers = [bench.publisher.add(b"%d" % number) for number in range(10)]
    for number in (0, 1, 9):
        bench.hear(headers[number], b"%d" % number)
    return headers


@pytest.mark.usefixtures("headers")
def test_what_is_kept_behind_a_link_that_is_away_for_a_while_is_not_given_up(bench):
    bench.go_on(30.0)
    assert bench.got == [b"0", b"1"]
    bench.session.reached.append(bench.publisher)
    bench.go_on(6.0)
    assert bench.got == [b"%d" % number for number in range(10)]
    assert bench.subscription.sequencer.lost == 0


@pytest.mark.usefixtures("headers")
def test_an_answer_ends_a_question_to_one_publisher_where_word_of_the_end_is_lost(bench):
    bench.session.loses_ends = True
    bench.session.reached.append(bench.publisher)
    bench.go_on(0.1)
    assert bench.got == [b"%d" % number for number in range(10)]
    assert not bench.subscription._questions


@pytest.mark.usefixtures("headers")
def test_what_nobody_has_is_given_up_after_a_minute_or_so(bench, caplog):
    bench.go_on(30.0)
    assert bench.got == [b"0", b"1"]
    bench.go_on(60.0)
    assert bench.got == [b"0", b"1", b"9"]
    assert "7 messages are lost" in caplog.text


@pytest.mark.usefixtures("headers")
def test_the_messages_of_a_life_that_has_ended_do_not_wait_so_long(bench):
    bench.go_on(2.0)
    later = PublisherCache(600)
    bench.session.reached.append(later)
    bench.hear(later.add(b"new"), b"new")
    assert bench.got == [b"0", b"1", b"new"]
    bench.go_on(10.0)
    assert bench.got == [b"0", b"1", b"new", b"9"]


def test_a_publisher_that_keeps_less_than_is_missing_is_not_asked_for_ever(bench, caplog):
    publisher = PublisherCache(5)
    headers = [publisher.add(b"%d" % number) for number in range(20)]
    bench.session.reached.append(publisher)
    for number in (0, 19):
        bench.hear(headers[number], b"%d" % number)
    bench.go_on(0.1)
    assert bench.got == [b"0", *(b"%d" % number for number in range(15, 20))]
    assert "14 messages are lost" in caplog.text


def test_each_key_is_asked_for_in_the_session_that_declared_it():
    made: list[Session] = [Session()]

    def further():
        made.append(Session())
        return made[-1]

    sessions = Sessions(made[0], further)
    keys = [f"wetwell/s{number}/sample" for number in range(40)]
    subscription = ZenohSubscription(sessions, [*keys, "wetwell/*/sample"], 1, Mailbox(100), print, recover=True)
    worker = ZenohWorker(sessions, is_router=False)
    worker._plan(RecoveryQuery(subscription, key) for key in subscription.keys)
    worker._ask(0.0)
    assert [session.asked for session in made] == [[*keys[:32], "wetwell/*/sample"], keys[32:]]
