"""Bus over Zenoh: one process is the router, the others are its clients. The only import of zenoh.

Nothing is found by scouting: a router listens on the endpoint that it is given, a client connects to it.
"""

import asyncio
import concurrent.futures
import contextlib
import json
import logging
import random
import re
import threading
from collections.abc import Iterator, Sequence
from datetime import timedelta
from typing import Any, Literal, Self

import zenoh
import zenoh.ext

from wetwell.protocols.errors import ConfigError, LinkError
from wetwell.protocols.link import Presence, Request
from wetwell.protocols.mailbox import Mailbox
from wetwell.protocols.messages import JSON_ENCODING
from wetwell.protocols.zenoh_access import OPEN, ZenohAccess

logger = logging.getLogger(__name__)

RECONNECT = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
"""How a client looks for a lost router. Zenoh's own 1 to 4 s would leave a gap of that length."""

LAST_LOSS_S = 1.0
"""So long after it a message that was lost, and that no other followed, is noticed."""

REQUESTS = 1_000
"""Most questions, or changes of presence, that wait for one reader."""


class ZenohPublisher:
    """Publisher on one key of a `ZenohBus`, with a cache for late joiners and for loss, and an answer to `get`."""

    def __init__(self, session: zenoh.Session, key: str, history: int) -> None:
        self._key = key
        self._last: bytes | None = None
        self._publisher = zenoh.ext.declare_advanced_publisher(
            session,
            key,
            encoding=JSON_ENCODING,
            congestion_control=zenoh.CongestionControl.DROP,
            cache=zenoh.ext.CacheConfig(max_samples=history),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=LAST_LOSS_S),
            publisher_detection=True,
        )
        self._queryable = session.declare_queryable(key, self._answer)

    def put(self, payload: bytes) -> None:
        """Send a message; without a router it is kept in the cache for the time after.

        Raises
        ------
        LinkError
            If the bus is closed.
        """
        self._last = payload
        try:  # not `_refusal`: this is once a message
            self._publisher.put(payload)
        except zenoh.ZError as error:
            raise LinkError(f"cannot publish on '{self._key}': {_reason(error)}") from error

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            if self._last is not None:
                query.reply(self._key, self._last, encoding=JSON_ENCODING)


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
    """A `Bus` over a Zenoh session. Close it, or use it in a `with`: else the process never ends.

    Characteristics: buffered: in each subscription, and in each publisher its last `history` messages · when full:
    the oldest is dropped and counted; on the way to a slow subscriber messages are dropped and asked for again from
    the publisher's history · threads: any may publish · reconnect: a client comes back by itself, usually
    within 0.5 s of the router; its publishers, subscriptions and what it announced are then as before.

    Messages that were lost, or sent while the router was away, come afterwards as far as the publisher keeps them:
    with a `history` at once, but after an absence no more than the last `history` of each publisher; without one
    after `LAST_LOSS_S`, and only of publishers from which something came before. A kept message may come twice:
    where that matters, drop it by its `seq`. Of many messages in the first milliseconds after `publisher` or
    `subscribe` the beginning can be lost for good.

    Parameters
    ----------
    session : zenoh.Session
        Open session; the bus closes it.
    is_router : bool
        Whether others connect to this session.
    """

    def __init__(self, session: zenoh.Session, *, is_router: bool) -> None:
        self._session = session
        self._is_router = is_router
        self._declared: list[object] = []  # zenoh undeclares what nobody holds
        self._exit = contextlib.ExitStack()
        self._exit.enter_context(session)
        self._lock = threading.Lock()  # zenoh refuses to be asked while another thread closes the session

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the network; twice is fine."""
        with self._lock:
            self._exit.close()

    def publisher(self, key: str, *, history: int = 1) -> ZenohPublisher:
        """Publisher on a key that keeps the last `history` messages for late joiners and for recovery of loss.

        Raises
        ------
        ValueError
            If `history` is below one.
        LinkError
            If the key is not a key expression or the bus is closed.
        """
        if history < 1:
            raise ValueError(f"history must be at least 1, got {history} (key '{key}')")
        with _refusal("publish on", key):
            publisher = ZenohPublisher(self._session, key, history)
        self._declared.append(publisher)
        return publisher

    def subscribe(
        self, key: str, *, history: int = 0, capacity: int = 10_000, recover: bool = True
    ) -> Mailbox[bytes]:
        """Subscription to a key expression, beginning with up to `history` kept messages of each publisher.

        Without `recover`, and without `history`, what is lost on the way stays lost.

        Raises
        ------
        LinkError
            If the key is not a key expression or the bus is closed.
        """
        mailbox: Mailbox[bytes] = Mailbox(capacity)

        def deliver(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                mailbox.put(sample.payload.to_bytes())

        if not recover and not history:
            with _refusal("subscribe to", key):
                self._declared.append(self._session.declare_subscriber(key, deliver))
            return mailbox
        kept = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=history) if history else None
        with _refusal("subscribe to", key):
            subscriber = zenoh.ext.declare_advanced_subscriber(
                self._session,
                key,
                deliver,
                history=kept,
                recovery=_recovery(with_history=history > 0),
            )
        self._declared.append(subscriber)
        return mailbox

    def answer(self, key: str) -> Mailbox[Request]:
        """Questions that are asked on a key from now on; each is to be answered.

        Raises
        ------
        LinkError
            If the key is not a key expression or the bus is closed.
        """
        mailbox: Mailbox[Request] = Mailbox(REQUESTS)

        def deliver(query: zenoh.Query) -> None:
            mailbox.put(ZenohRequest(query, str(query.key_expr) if "*" in key else key))

        with _refusal("answer", key):
            self._declared.append(self._session.declare_queryable(key, deliver))
        return mailbox

    async def ask(self, key: str, payload: bytes = b"", *, timeout_s: float = 5.0) -> list[bytes]:
        """Answers to a question; of a key with a publisher also its last message. None in time: an empty list.

        Raises
        ------
        LinkError
            If the key is not a key expression or the bus is closed.
        """
        loop, ended, answers = asyncio.get_running_loop(), asyncio.Event(), list[bytes]()

        def take(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                answers.append(reply.ok.payload.to_bytes())

        def end() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended: nobody waits
                loop.call_soon_threadsafe(ended.set)

        with _refusal("ask", key):
            self._session.get(
                key,
                zenoh.handlers.Callback(take, end),
                payload=payload,
                encoding=JSON_ENCODING,
                target=zenoh.QueryTarget.ALL,
                timeout=timeout_s,
            )
        await ended.wait()
        return answers

    def watch(self, key: str) -> Mailbox[Presence]:
        """Services that are announced under a key expression: those that live now, then each change.

        Raises
        ------
        LinkError
            If the key is not a key expression or the bus is closed.
        """
        mailbox: Mailbox[Presence] = Mailbox(REQUESTS)

        def deliver(sample: zenoh.Sample) -> None:
            mailbox.put(Presence(str(sample.key_expr), is_alive=sample.kind == zenoh.SampleKind.PUT))

        with _refusal("watch", key):
            self._declared.append(self._session.liveliness().declare_subscriber(key, deliver, history=True))
        return mailbox

    def announce(self, key: str) -> None:
        """Show under a key that this service lives, by a liveliness token that goes with the connection.

        Raises
        ------
        LinkError
            If the key is not a key expression or the bus is closed.
        """
        with _refusal("announce", key):
            self._declared.append(self._session.liveliness().declare_token(key))

    @property
    def is_connected(self) -> bool:
        """Whether messages can reach others now: a router always, a client while it has its router."""
        with self._lock:
            if self._session.is_closed():
                return False
            return self._is_router or bool(self._session.info.routers_zid())


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
    config = _config("router", endpoint, access)
    config.insert_json5("scouting/delay", "0")  # nobody is scouted: do not wait for answers
    if upstream:
        config.insert_json5("connect/endpoints", json.dumps(list(upstream)))
        config.insert_json5("connect/retry", json.dumps(RECONNECT))
    try:
        return ZenohBus(zenoh.open(config), is_router=True)
    except zenoh.ZError as error:
        raise LinkError(f"cannot listen on {endpoint}: {_reason(error)}") from error


def open_client(endpoint: str, access: ZenohAccess = OPEN, *, timeout_s: float = 2.0) -> ZenohBus:
    """Bus through the router at an endpoint; waits up to `timeout_s` for it.

    Raises
    ------
    ConfigError
        If `endpoint` is not of the form `tcp/127.0.0.1:7447`, or something of `access` is missing or cannot be read.
    LinkError
        If no router is reached in time. Zenoh does not tell wrong credentials from a router that is not there.
    """
    config = _config("client", endpoint, access)
    config.insert_json5("connect/timeout_ms", str(max(1, round(timeout_s * 1000))))
    config.insert_json5("connect/retry", json.dumps(RECONNECT))
    try:
        return ZenohBus(zenoh.open(config), is_router=False)
    except zenoh.ZError as error:
        doubt = f"it is away or refuses {access.shown}" if access.shown else "wrong credentials look the same"
        raise LinkError(f"no router reached at {endpoint} within {timeout_s:g} s ({doubt})") from error


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


def _recovery(*, with_history: bool) -> zenoh.ext.RecoveryConfig:
    """How a subscription notices that the last message was lost: by heartbeats, or by asking the known publishers.

    A heartbeat of a publisher that is not known yet brings all that it keeps: not wanted without history.
    """
    if with_history:
        return zenoh.ext.RecoveryConfig(heartbeat=True, periodic_queries=None)
    period: Any = timedelta(seconds=LAST_LOSS_S)  # zenoh's stub says float, zenoh 1.10 takes only this
    return zenoh.ext.RecoveryConfig(heartbeat=None, periodic_queries=period)


def _config(mode: Literal["router", "client"], endpoint: str, access: ZenohAccess) -> zenoh.Config:
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": mode,
        "listen/endpoints": [endpoint] if mode == "router" else [],
        "connect/endpoints": [endpoint] if mode == "client" else [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
    }
    try:
        for name, value in settings.items():
            config.insert_json5(name, json.dumps(value))
    except zenoh.ZError as error:
        raise ConfigError(f"endpoint must be of the form tcp/ADDRESS:PORT, got '{endpoint}'") from error
    for name, value in access.settings(mode, endpoint).items():
        try:
            config.insert_json5(name, json.dumps(value))
        except zenoh.ZError:  # its text may hold a password
            raise ConfigError(f"zenoh refuses the settings of {name}") from None
    return config


@contextlib.contextmanager
def _refusal(act: str, key: str) -> Iterator[None]:
    """Turn what Zenoh refuses into a `LinkError` that names the act and the key."""
    try:
        yield
    except zenoh.ZError as error:
        raise LinkError(f"cannot {act} '{key}': {_reason(error)}") from error


def _reason(error: zenoh.ZError) -> str:
    """What a Zenoh error says, in one line, without places in its source."""
    system = re.search(r"[^:\[]+(?= \(os error \d+\))", str(error))
    if system:
        return system.group().strip().lower()
    return " ".join(re.sub(r" at /\S+\.rs:\d+\.?", "", str(error)).split())
