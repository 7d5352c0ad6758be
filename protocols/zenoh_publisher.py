"""One key of a Zenoh bus, from the side of who publishes."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import zenoh

from wetwell.protocols.errors import LinkError
from wetwell.protocols.kept import KeptMessages, read_query
from wetwell.protocols.keys import tail_key
from wetwell.protocols.messages import JSON_ENCODING
from wetwell.protocols.zenoh_session import reason


@dataclass
class Waiting:
    """What publishers leave to the thread of their bus: to say that they have fallen silent, and to answer."""

    unsettled: "set[ZenohPublisher]" = field(default_factory=set)
    questions: "deque[tuple[ZenohPublisher, zenoh.Query]]" = field(default_factory=deque)


class ZenohPublisher:
    """Publisher on one key of a `ZenohBus`; keeps its last messages for late joiners and for loss; answers `get`."""

    def __init__(self, session: zenoh.Session, key: str, history: int, waiting: Waiting) -> None:
        self.key = key
        self.kept = KeptMessages(history)
        self.sent_s = 0.0
        self._session = session
        self._waiting = waiting
        self._lock = threading.Lock()
        self._publisher = session.declare_publisher(
            key, encoding=JSON_ENCODING, congestion_control=zenoh.CongestionControl.DROP
        )
        self._queryable = session.declare_queryable(key, at_once(self._ask))

    def put(self, payload: bytes) -> None:
        """Send a message; without a router it is kept for the time after.

        Raises
        ------
        LinkError
            If the bus is closed.
        """
        with self._lock:  # what is numbered first is sent first
            mark = self.kept.add(payload)
            try:  # not `refusal`: this is once a message
                self._publisher.put(payload, attachment=mark)
            except zenoh.ZError as error:
                raise LinkError(f"cannot publish on '{self.key}': {reason(error)}") from error
        self.sent_s = time.monotonic()
        self._waiting.unsettled.add(self)

    def _ask(self, query: zenoh.Query) -> None:
        self._waiting.questions.append((self, query))

    def answer(self, query: zenoh.Query) -> None:
        """Answer what is kept, or the last message to those who only ask for that."""
        asked = None if query.payload is None else read_query(query.payload.to_bytes())
        with query:
            if asked is None:
                if (last := self.kept.last) is not None:
                    query.reply(self.key, last, encoding=JSON_ENCODING)
            elif (page := self.kept.page(asked)) is not None:
                body, head = page.encode()
                query.reply(self.key, body, attachment=head)

    def tell_end(self) -> None:
        """Tell those who follow which message was the last."""
        drop = zenoh.CongestionControl.DROP
        self._session.put(tail_key(self.key), b"", attachment=self.kept.next_mark, congestion_control=drop)


def at_once(take: Callable[[Any], None]) -> "zenoh.handlers.Callback[Any]":
    """A callback in the thread of the session, for what is rare and takes no time. By default each has a thread."""
    return zenoh.handlers.Callback(take, indirect=False)
