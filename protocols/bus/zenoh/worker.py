"""The thread of a Zenoh bus: fetches what has come, asks for what is missing, answers those who ask.

Zenoh's own threads put messages into channels without Python's lock. A callback for each message would wait for
that lock while the process computes, up to 5 ms a message.
"""

import logging
import random
import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import zenoh

from wetwell.protocols.bus.publisher_cache import CacheQuery, Page
from wetwell.protocols.bus.sequencer import SourceStream
from wetwell.protocols.bus.zenoh.ends import Ends
from wetwell.protocols.bus.zenoh.publisher import LAST_LOSS_S, ZenohPublisher
from wetwell.protocols.bus.zenoh.sessions import Line, Sessions
from wetwell.protocols.bus.zenoh.subscription import ZenohSubscription
from wetwell.protocols.messages.message import JSON_ENCODING

logger = logging.getLogger(__name__)

PERIOD_S = 0.01
"""So often answers are looked for while some are awaited. [s]"""
IDLE_S = 0.02
"""So often questions are, and publishers that have fallen silent. [s]"""
LEAST_SLEEP_S = 0.001
"""So that the threads of the process have their turn. [s]"""
ASKED = 64
"""Questions for missing messages that are on the way at the same time."""
ANSWER_S = 2.0
REPLIES = 10_000
"""Answers to one question that may wait: one of each publisher on its keys."""
TRIES = 5
PATIENT_TRIES = 20
"""Of messages whose publisher may be behind a link between routers that is away: about a minute."""
FIRST_WAIT_S = 0.1
"""Longest wait before the second try; it doubles with each, and is drawn at random."""
LONGEST_WAIT_S = 5.0

LAST_MESSAGE_QUERY = CacheQuery().encode()


@dataclass
class RecoveryQuery:
    """A question for missing messages of a stream, or for the last message of all publishers on a key."""

    subscription: ZenohSubscription
    key: str
    stream: SourceStream | None = None
    due_s: float = 0.0
    begin: int = 0
    tries: int = 0
    replies: Any = None
    is_refused: bool = False


class ZenohWorker(threading.Thread):
    """Serves all subscriptions and publishers of a bus until it is stopped.

    Parameters
    ----------
    sessions : Sessions
    is_router : bool
        Whether others connect to them.
    """

    def __init__(self, sessions: Sessions, *, is_router: bool) -> None:
        super().__init__(name="zenoh-worker")
        self.queries: deque[tuple[ZenohPublisher, zenoh.Query]] = deque()
        self.ends = Ends()
        self._sessions = sessions
        self._is_router = is_router
        self._subscriptions: list[ZenohSubscription] = []
        self._publishers: list[ZenohPublisher] = []
        self._due: deque[RecoveryQuery] = deque()
        self._asked: list[RecoveryQuery] = []
        self._stopping = threading.Event()
        self._lock = threading.Lock()

    def add_publisher(self, publisher: ZenohPublisher) -> None:
        """Serve a publisher from now on."""
        self._publishers.append(publisher)
        self._begin()

    def add_subscription(self, subscription: ZenohSubscription) -> None:
        """Serve a subscription from now on, beginning with what is kept of it."""
        if subscription.history:
            self._plan(RecoveryQuery(subscription, key) for key in subscription.keys)
        self._subscriptions.append(subscription)
        self._begin()

    def stop(self) -> None:
        """End the thread; twice is fine."""
        self._stopping.set()
        if self.is_alive() and threading.current_thread() is not self:
            self.join()

    def _begin(self) -> None:
        with self._lock:
            if self.ident is None:
                self.start()

    def run(self) -> None:
        """Serve until stopped."""
        due_s = 0.0
        while not self._stopping.is_set():
            now_s = time.monotonic()
            try:
                for subscription in self._subscriptions:
                    if subscription.due_s <= now_s:
                        subscription.fetch(now_s)
                if due_s <= now_s:
                    due_s = now_s + (PERIOD_S if self._asked or self._due else IDLE_S)
                    self._answer()
                    self._settle(now_s)
                    self._handle_answers(now_s)
                    self._ask(now_s)
            except Exception:  # one odd message must not make the process deaf
                if self._sessions.is_closed:
                    return
                logger.exception("bus")
            next_s = min([due_s, *(subscription.due_s for subscription in self._subscriptions)])
            time.sleep(max(next_s - time.monotonic(), LEAST_SLEEP_S))

    def _answer(self) -> None:
        while self.queries:
            publisher, query = self.queries.popleft()
            publisher.answer(query)

    def _settle(self, now_s: float) -> None:
        """Say of each publisher that has fallen silent, or whose link was away, which message was its last."""
        for line in self._sessions.lines:
            if line.has_come_back.is_set():
                line.has_come_back.clear()
                self._stir(line, now_s)
        if not self._sessions.pace.is_behind:  # a first end is declared
            self.ends.settle(now_s)

    def _stir(self, line: Line, now_s: float) -> None:
        for publisher in self._publishers:
            if publisher.line is line:
                publisher.stir(now_s)
        self.ends.look_at_all()
        due_s = now_s + random.uniform(0.0, LAST_LOSS_S / 2.0)
        self._plan(
            RecoveryQuery(subscription, key, due_s=due_s)
            for subscription in self._subscriptions
            if subscription.recovers
            for key, its in subscription.keys.items()
            if its is line
        )

    def _plan(self, queries: Iterable[RecoveryQuery]) -> None:
        for query in queries:
            query.subscription.await_answers(1)
            self._due.append(query)

    def _handle_answers(self, now_s: float) -> None:
        """Take the answers that have come."""
        going: list[RecoveryQuery] = []
        for query in self._asked:
            if self._handle_replies(query):
                going.append(query)
            else:
                self._finish(query, now_s)
        self._asked = going

    def _handle_replies(self, query: RecoveryQuery) -> bool:
        """Whether more may come."""
        subscription = query.subscription
        try:
            while (reply := query.replies.try_recv()) is not None:
                if reply.ok is None:
                    query.is_refused = True
                    continue
                head = reply.ok.attachment
                page = head and Page.decode(reply.ok.payload.to_bytes(), head.to_bytes())
                if page:
                    subscription.handle_page(str(reply.ok.key_expr), page, is_from_next=query.stream is not None)
                    if query.stream is not None:  # it has one source; word that nobody else answers may be lost
                        return False
        except zenoh.ZError:  # all that were asked have answered
            return False
        finally:
            subscription.pass_on()
        return True

    def _finish(self, query: RecoveryQuery, now_s: float) -> None:
        """Ask again, later, where that may help; give up in the end."""
        stream = query.stream
        if stream is None:
            is_done = not (query.is_refused and query.subscription.history)
        else:
            if stream.next > query.begin:  # there was more than fits into one answer
                query.tries = 0
            is_done = not stream.is_missing
            stream.is_asked = not is_done
        if is_done:
            query.subscription.await_answers(-1)
            return
        query.tries += 1
        is_patient = stream is not None and not query.subscription.sequencer.is_replaced(stream)
        if query.tries > (PATIENT_TRIES if is_patient else TRIES):
            if stream is not None:
                stream.is_asked = False
                query.subscription.give_up(stream)
            query.subscription.await_answers(-1)
            return
        if query.tries > 1:
            longest_s = min(FIRST_WAIT_S * 2.0 ** (query.tries - 1), LONGEST_WAIT_S)
            query.due_s = now_s + random.uniform(longest_s / 2.0, longest_s)
        self._due.append(query)

    def _ask(self, now_s: float) -> None:
        """Ask for what is missing, as far as not too many questions are on the way."""
        for subscription in self._subscriptions:
            for stream in subscription.sequencer.wanted.values():
                stream.is_asked = True
                self._plan([RecoveryQuery(subscription, stream.key, stream)])
            subscription.sequencer.wanted.clear()
        if not self._due:
            return
        reaching = {line for line in self._sessions.lines if self._is_router or line.is_connected}
        for _ in range(len(self._due)):
            if len(self._asked) >= ASKED:
                return
            query = self._due.popleft()
            line = query.subscription.keys.get(query.key, self._sessions.first)
            if query.due_s > now_s or query.subscription.is_crowded or line not in reaching:
                self._due.append(query)
                continue
            self._send(query, line)
            self._asked.append(query)

    def _send(self, query: RecoveryQuery, line: Line) -> None:
        """Ask where the key was declared: the router hears of that before, and what comes afterwards comes here."""
        stream, payload, manners = query.stream, LAST_MESSAGE_QUERY, zenoh.CongestionControl.BLOCK
        if stream is not None:
            query.begin = stream.next
            payload = CacheQuery(source=stream.source.hex(), begin=stream.next).encode()
            manners = zenoh.CongestionControl.DROP  # the answer is large: rather ask again than block a router
        query.is_refused = False
        query.replies = line.session.get(
            query.key,
            zenoh.handlers.FifoChannel(REPLIES),
            payload=payload,
            encoding=JSON_ENCODING,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=manners,
            timeout=ANSWER_S,
        )
