"""One key of a Zenoh bus, from the side of who publishes."""

import threading
import time
from collections import deque

import zenoh

from wetwell.protocols.bus.keys import tail_key
from wetwell.protocols.bus.publisher_cache import PublisherCache, read_query
from wetwell.protocols.bus.zenoh.ends import Speaker
from wetwell.protocols.bus.zenoh.session import at_once, reason
from wetwell.protocols.bus.zenoh.sessions import Line
from wetwell.protocols.errors import LinkError
from wetwell.protocols.messages.message import JSON_ENCODING

LAST_LOSS_S = 1.0
"""So long after a message that no other followed its publisher says that it was the last."""
LONGEST_SILENCE_S = 60.0
"""So long at most until it says so again."""
SAME_PAUSE = 0.2
"""Share by which one pause may differ from the one before in a rhythm."""
DROP = zenoh.CongestionControl.DROP
OF_A_PUBLISHER = 4
"""Declarations: its key, what answers on it, the key on which it says what was its last message, and its token."""


def end_due_s(silent_s: float, told_s: float, rhythm_s: float = 0.0) -> float:
    """When a publisher should say, again, which message was its last: 1, 4, 16, 64 s after it, then each 60 s.

    Once is not enough: where a link between two routers was away, neither the publisher nor who has missed
    something is told of it. As the waits grow, what was lost is known within four times as long as the link was away.
    Who speaks in a rhythm has nothing to say until it has missed its turn: its next message shows what is missing.

    Parameters
    ----------
    silent_s : float
        Since when it is silent. [s]
    told_s : float
        When it has said so before. [s]
    rhythm_s : float
        From each message to the next; 0 if that differs. [s]

    Examples
    --------
    >>> [end_due_s(10.0, told_s) for told_s in (0.0, 11.0, 500.0)]
    [11.0, 14.0, 560.0]
    >>> end_due_s(10.0, 0.0, rhythm_s=10.0)
    30.0
    """
    first_s = max(LAST_LOSS_S, min(2.0 * rhythm_s, LONGEST_SILENCE_S))
    wait_s = min(3.0 * (told_s - silent_s), LONGEST_SILENCE_S) if told_s > silent_s else 0.0
    return max(silent_s + first_s, told_s + wait_s)


class ZenohPublisher:
    """Publisher on one key of a `ZenohBus`; keeps its last messages for late joiners and for loss; answers `get`.

    Attributes
    ----------
    line : Line
        Where it was declared.
    rests_until_s : float
        Until then `settle` need not be asked; what is sent moves it. [s]
    """

    def __init__(
        self,
        line: Line,
        key: str,
        cache: PublisherCache,
        queries: "deque[tuple[ZenohPublisher, zenoh.Query]]",
        spoken: "deque[Speaker]",
    ) -> None:
        self.key = key
        self.cache = cache
        self.rests_until_s = 0.0
        self._silent_s = 0.0
        self._told_s = 0.0
        self._pause_s = 0.0
        self._rhythm_s = 0.0
        self.line = line
        self._tail: zenoh.KeyExpr | None = None
        self._token: zenoh.LivelinessToken | None = None
        self._queries = queries
        self._spoken = spoken
        self._is_awaited = False
        self._lock = threading.Lock()
        self._put = line.session.put
        self._numbered = line.numbered(key)
        self._queryable = line.session.declare_queryable(key, at_once(self._ask))
        if cache.end:
            self._await()

    def put(self, payload: bytes, weight: int = 1) -> None:
        """Send a message, which counts as `weight` kept ones; without a router it is kept for the time after.

        Raises
        ------
        LinkError
            If the bus is closed.
        """
        with self._lock:  # what is numbered first is sent first
            header = self.cache.add(payload, weight)
            try:  # not `refusal`: this is once a message
                self._put(self._numbered, payload, encoding=JSON_ENCODING, attachment=header, congestion_control=DROP)
            except zenoh.ZError as error:
                raise LinkError(f"cannot publish on '{self.key}': {reason(error)}") from error
            now_s = time.monotonic()
            pause_s = now_s - self._silent_s
            self._rhythm_s = pause_s if abs(pause_s - self._pause_s) < SAME_PAUSE * pause_s else 0.0
            self._pause_s, self._silent_s = pause_s, now_s
            self.rests_until_s = end_due_s(now_s, self._told_s, self._rhythm_s)
            if not self._is_awaited:
                self._await()

    def _await(self) -> None:
        self._is_awaited = True
        self._spoken.append(self)

    def _ask(self, query: zenoh.Query) -> None:
        self._queries.append((self, query))

    def answer(self, query: zenoh.Query) -> None:
        """Answer what is kept, or the last message to those who only ask for that."""
        asked = None if query.payload is None else read_query(query.payload.to_bytes())
        with query:
            if asked is None:
                if (last := self.cache.last) is not None:
                    query.reply(self.key, last, encoding=JSON_ENCODING)
            elif (page := self.cache.page(asked)) is not None:
                body, head = page.encode()
                query.reply(self.key, body, attachment=head)

    def stir(self, now_s: float) -> None:
        """Say which message was the last as if it had just been sent: the link was away."""
        self._silent_s, self._told_s, self._rhythm_s = now_s - LAST_LOSS_S, 0.0, 0.0
        self.rests_until_s = 0.0

    def settle(self, now_s: float) -> bool:
        """Tell those who follow which message was the last, if it is time to; whether it was."""
        with self._lock:
            due_s = end_due_s(self._silent_s, self._told_s, self._rhythm_s)
            is_due = due_s < now_s
            self._told_s = now_s if is_due else self._told_s
            self.rests_until_s = end_due_s(self._silent_s, now_s) if is_due else due_s
        if is_due:
            self._tell_end()
        return is_due

    def _tell_end(self) -> None:
        if self._tail is None:
            key = tail_key(self.key)
            self._tail = self.line.numbered(key)
            self._token = self.line.token(key)  # else no router knows the key
        self._put(self._tail, b"", attachment=self.cache.next_header, congestion_control=DROP)
