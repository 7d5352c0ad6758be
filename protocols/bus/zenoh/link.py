"""Bus over Zenoh: one process is the router, the others are its clients."""

import asyncio
import concurrent.futures
import contextlib
import logging
import random
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Self

import zenoh

from wetwell.protocols.bus.interface import PACE_S, KeptStream, Keyed, Presence, Request
from wetwell.protocols.bus.mailbox import Mailbox
from wetwell.protocols.bus.publisher_cache import PublisherCache
from wetwell.protocols.bus.zenoh.access import OPEN, ZenohAccess
from wetwell.protocols.bus.zenoh.publisher import OF_A_PUBLISHER, ZenohPublisher
from wetwell.protocols.bus.zenoh.session import at_once, open_client_session, open_router_session, refusal
from wetwell.protocols.bus.zenoh.sessions import Sessions
from wetwell.protocols.bus.zenoh.subscription import ZenohSubscription
from wetwell.protocols.bus.zenoh.worker import ZenohWorker
from wetwell.protocols.errors import LinkError
from wetwell.protocols.messages.message import JSON_ENCODING

logger = logging.getLogger(__name__)

HANDSHAKE_S = 10.0
"""So long Zenoh lets a handshake take. A router of thousands of stations that begin is busy for a minute. [s]"""
MOST_REQUESTS = 1_000
"""Most questions, or changes of presence, that wait for one reader."""


class ZenohRequest:
    """Question that came over Zenoh."""

    def __init__(self, query: zenoh.Query, reply_key: str) -> None:
        self.key = str(query.key_expr)
        self.payload = b"" if query.payload is None else query.payload.to_bytes()
        self._query = query
        self._reply_key = reply_key

    def reply(self, payload: bytes) -> None:
        """Answer it; nothing happens if who asked is gone."""
        with contextlib.suppress(zenoh.ZError), self._query:
            self._query.reply(self._reply_key, payload, encoding=JSON_ENCODING)


class ZenohBus:
    """A `Bus` over Zenoh sessions. Close it, or use it in a `with`: else the process never ends.

    Characteristics: buffered: in each subscription, and in each publisher its last `history` messages, both with a
    bound in bytes · when full: a subscription that recovers lets messages go, as a slow way to it does, and asks for
    them again from the publisher's history when there is room; one that does not drops the oldest and counts it ·
    threads: any may publish; one of the bus's own fetches what has come, at the pace of each subscription ·
    reconnect: a client comes back by itself, usually within 0.5 s of the router; its publishers, subscriptions and
    what it announced are then as before.

    The messages of one publisher come in their order, each once. What was lost, or sent while a router was away,
    comes afterwards as far as the publisher keeps it; later messages of it wait until then, about a minute where
    nobody answers. The last one of a publisher that falls silent is missed after a second, behind a link between
    routers that was away after a minute at most. Without a `history` a subscription begins with the first message
    that reaches it.

    Parameters
    ----------
    sessions : Sessions
        Open ones; the bus closes them.
    is_router : bool
        Whether others connect to them.

    Raises
    ------
    LinkError
        By every method that has a key, if that is not a key expression or the bus is closed.
    """

    def __init__(self, sessions: Sessions, *, is_router: bool) -> None:
        self._sessions = sessions
        self._is_router = is_router
        self._declared: list[object] = []  # zenoh undeclares what nobody holds
        self._worker = ZenohWorker(sessions, is_router=is_router)
        self._lock = threading.Lock()  # zenoh refuses to be asked while another thread closes the session

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the network; twice is fine."""
        with self._lock:
            self._worker.stop()
            self._sessions.close()

    def publisher(self, key: str, *, history: int = 1, goes_on: KeptStream | None = None) -> ZenohPublisher:
        """Publisher on a key that keeps the last `history` messages for late joiners and for recovery of loss.

        With `goes_on` it continues the stream of others before it: their source, their numbers, what they kept.

        Raises
        ------
        ValueError
            If `history` is below one.
        """
        if history < 1:
            raise ValueError(f"history must be at least 1, got {history} (key '{key}')")
        with refusal("publish on", key):
            cache = PublisherCache(history, goes_on)
            line = self._sessions.with_room(OF_A_PUBLISHER)
            publisher = ZenohPublisher(line, key, cache, self._worker.queries, self._worker.ends.spoken)
        self._worker.add_publisher(publisher)
        return publisher

    def subscribe(
        self, key: str, *, history: int = 0, capacity: int = 10_000, recover: bool = True, pace_s: float = PACE_S
    ) -> Mailbox[bytes]:
        """Subscription to a key expression, beginning with up to `history` kept messages of each publisher.

        Without `recover`, and without `history`, what is lost on the way stays lost.
        """
        mailbox: Mailbox[bytes] = Mailbox(capacity, len)

        def deliver(messages: list[Keyed]) -> None:
            mailbox.extend([payload for _, payload in messages])

        self._subscribe([key], history, mailbox, deliver, recover=recover, pace_s=pace_s)
        return mailbox

    def collect(
        self,
        keys: Sequence[str],
        *,
        history: int = 0,
        capacity: int = 10_000,
        recover: bool = True,
        pace_s: float = PACE_S,
    ) -> Mailbox[Keyed]:
        """One subscription to many keys, whose messages come with their keys."""
        mailbox: Mailbox[Keyed] = Mailbox(capacity, _size_bytes)
        self._subscribe(keys, history, mailbox, mailbox.extend, recover=recover, pace_s=pace_s)
        return mailbox

    def _subscribe(
        self,
        keys: Sequence[str],
        history: int,
        mailbox: Mailbox[Any],
        deliver: Callable[[list[Keyed]], None],
        *,
        recover: bool,
        pace_s: float,
    ) -> None:
        with refusal("subscribe to", ", ".join(keys[:3])):
            subscription = ZenohSubscription(
                self._sessions, keys, history, mailbox, deliver, recover=recover, pace_s=pace_s
            )
            self._worker.add_subscription(subscription)

    def answer(self, key: str) -> Mailbox[Request]:
        """Questions that are asked on a key from now on; each is to be answered."""
        mailbox: Mailbox[Request] = Mailbox(MOST_REQUESTS)

        def deliver(query: zenoh.Query) -> None:
            mailbox.put(ZenohRequest(query, str(query.key_expr) if "*" in key else key))

        with refusal("answer", key):
            line = self._sessions.first if "*" in key else self._sessions.with_room(1)
            self._declared.append(line.session.declare_queryable(key, at_once(deliver)))
        return mailbox

    async def ask(self, key: str, payload: bytes = b"", *, timeout_s: float = 5.0) -> list[bytes]:
        """Answers to a question; of a key with a publisher also its last message. None in time: an empty list."""
        loop, ended, answers = asyncio.get_running_loop(), asyncio.Event(), list[bytes]()

        def handle_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                answers.append(reply.ok.payload.to_bytes())

        def end() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended: nobody waits
                loop.call_soon_threadsafe(ended.set)

        with refusal("ask", key):
            self._sessions.first.session.get(
                key,
                zenoh.handlers.Callback(handle_reply, end, indirect=False),
                payload=payload,
                encoding=JSON_ENCODING,
                target=zenoh.QueryTarget.ALL,
                timeout=timeout_s,
            )
        await ended.wait()
        return answers

    def watch(self, key: str) -> Mailbox[Presence]:
        """Services that are announced under a key expression: those that live now, then each change."""
        mailbox: Mailbox[Presence] = Mailbox(MOST_REQUESTS)

        def deliver(sample: zenoh.Sample) -> None:
            mailbox.put(Presence(str(sample.key_expr), is_alive=sample.kind == zenoh.SampleKind.PUT))

        with refusal("watch", key):
            session = self._sessions.apart()
            self._declared.append(session.liveliness().declare_subscriber(key, at_once(deliver), history=True))
        return mailbox

    def announce(self, key: str) -> None:
        """Show under a key that this service lives, by a liveliness token that goes with the connection."""
        with refusal("announce", key):
            session = self._sessions.with_room(1).session
            self._declared.append(session.liveliness().declare_token(key))

    @property
    def is_connected(self) -> bool:
        """Whether messages can reach others now: a router always, a client while it has its router."""
        with self._lock:
            return not self._sessions.is_closed and (self._is_router or self._sessions.is_connected)


def _size_bytes(message: Keyed) -> int:
    return len(message[1])


def open_router(endpoint: str, access: ZenohAccess = OPEN, upstream: Sequence[str] = ()) -> ZenohBus:
    """Bus to which others connect; with `upstream` a branch of the tree of those routers, looked for until there.

    Parameters
    ----------
    endpoint : str
        Where to listen, such as `tcp/127.0.0.1:7447`, or `tls/...` with a certificate.
    access : ZenohAccess
        Who may come, and what they may do.
    upstream : sequence of str
        Endpoints of routers that this one connects to.

    Raises
    ------
    ConfigError
        If `endpoint` is not of that form, or something of `access` is missing or cannot be read.
    LinkError
        If the endpoint cannot be listened on, most often because another program does.
    """
    return ZenohBus(Sessions(open_router_session(endpoint, access, upstream)), is_router=True)


def open_client(endpoint: str, access: ZenohAccess = OPEN, *, timeout_s: float = 2.0) -> ZenohBus:
    """Bus through the router at an endpoint; waits up to `timeout_s` for it.

    Raises
    ------
    ConfigError
        If `endpoint` is not of the form `tcp/127.0.0.1:7447`, or something of `access` is missing or cannot be read.
    LinkError
        If no router is reached in time. Zenoh does not tell wrong credentials from a router that is not there.
    """
    first = open_client_session(endpoint, access, timeout_s)
    further = partial(open_client_session, endpoint, access, max(timeout_s, HANDSHAKE_S))
    return ZenohBus(Sessions(first, further), is_router=False)


async def connect_client(
    endpoint: str, access: ZenohAccess = OPEN, *, timeout_s: float = 2.0, longest_wait_s: float = 10.0
) -> ZenohBus:
    """Bus through the router at an endpoint; tries until it is there, with full jitter, and logs each failure.

    Parameters
    ----------
    endpoint : str
        Where the router listens, such as `tcp/127.0.0.1:7447`.
    access : ZenohAccess
        Who this client is.
    timeout_s : float
        Time limit of one try. [s]
    longest_wait_s : float
        Upper limit of the random wait between two tries, which otherwise grows as 1.5^n. [s]

    Raises
    ------
    ConfigError
        If `endpoint` is not of that form or `access` is wrong in itself: no later try would help.
    """
    attempt = 0
    while True:
        try:
            return await _open_in_thread(endpoint, access, timeout_s)
        except LinkError as error:
            attempt += 1
            wait_s = random.uniform(0.0, min(longest_wait_s, 1.5 ** min(attempt, 100)))
            logger.warning("%s; try %d, next in %.1f s", error, attempt, wait_s)
        await asyncio.sleep(wait_s)


async def _open_in_thread(endpoint: str, access: ZenohAccess, timeout_s: float) -> ZenohBus:
    """Open a client without blocking the loop; a bus that comes after a cancellation is closed in the thread."""
    executor = concurrent.futures.ThreadPoolExecutor(max_workers=1, thread_name_prefix="zenoh-open")
    opening = executor.submit(open_client, endpoint, access, timeout_s=timeout_s)
    executor.shutdown(wait=False)
    try:
        return await asyncio.wrap_future(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(_close_late)
        raise


def _close_late(opening: concurrent.futures.Future[ZenohBus]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()
