"""Bus within one process, for tests and benchmarks of what meets on a bus."""

import asyncio
import contextlib
import functools
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Self

from wetwell.protocols.bus.interface import PACE_S, KeptStream, Keyed, Presence, Request
from wetwell.protocols.bus.mailbox import Mailbox

REQUESTS = 1_000
"""Most questions, or changes of presence, that wait for one reader."""


class KeptMessages:
    """The last messages on a key, one at least; one that holds many things counts as many."""

    def __init__(self) -> None:
        self.payloads: deque[bytes] = deque()
        self._weights: deque[int] = deque()
        self._history = 1

    def keep(self, history: int) -> None:
        """Keep so many from now on."""
        self._history = history
        while sum(self._weights) > history and len(self.payloads) > 1:
            self.payloads.popleft()
            self._weights.popleft()

    def add(self, payload: bytes, weight: int) -> None:
        """Keep a message that counts as so many."""
        self.payloads.append(payload)
        self._weights.append(weight)
        self.keep(self._history)


class MemoryBus:
    """A `Bus` on which everybody in the process meets.

    Characteristics: buffered: in each subscription · when full: drops the oldest and counts it · threads: any may
    publish and subscribe · reconnect: never lost, `is_connected` is always true. Kept messages live as long as the
    bus, so unlike on a network they outlive their publisher. A message arrives once.

    Examples
    --------
    >>> import asyncio
    >>> bus = MemoryBus()
    >>> bus.publisher("wetwell/alpha/status/plc").put(b"{}")
    >>> late = bus.subscribe("wetwell/*/status/**", history=1)
    >>> asyncio.run(late.receive()), bus.get("wetwell/alpha/status/plc")
    ([b'{}'], b'{}')
    """

    def __init__(self) -> None:
        self.alive: set[str] = set()
        self._kept: dict[str, KeptMessages] = {}
        self._subscriptions: list[tuple[str, Callable[[str, bytes], None]]] = []
        self._answerers: list[tuple[str, Mailbox[Request]]] = []
        self._watchers: list[tuple[str, Mailbox[Presence]]] = []
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Forget what was announced, as if the process had left the network."""
        for key in list(self.alive):
            self.alive.discard(key)
            self._tell(Presence(key, is_alive=False))

    def publisher(
        self,
        key: str,
        *,
        history: int = 1,
        goes_on: KeptStream | None = None,  # noqa: ARG002 - what is kept here outlives its publisher
    ) -> "MemoryPublisher":
        """Publisher on a key that keeps the last `history` messages for late joiners.

        Raises
        ------
        ValueError
            If `history` is below one.
        """
        if history < 1:
            raise ValueError(f"history must be at least 1, got {history} (key '{key}')")
        with self._lock:
            self._kept.setdefault(key, KeptMessages()).keep(history)
        return MemoryPublisher(self, key)

    def put(self, key: str, payload: bytes, weight: int = 1) -> None:
        """Send a message on a key that has a publisher."""
        with self._lock:
            self._kept[key].add(payload, weight)
            for expression, take in self._subscriptions:
                if matches(expression, key):
                    take(key, payload)

    def subscribe(
        self,
        key: str,
        *,
        history: int = 0,
        capacity: int = 10_000,
        recover: bool = True,  # noqa: ARG002 - nothing is lost here
        pace_s: float = PACE_S,  # noqa: ARG002 - what comes is there at once
    ) -> Mailbox[bytes]:
        """Subscription to a key expression, beginning with up to `history` kept messages of each key in it."""
        mailbox: Mailbox[bytes] = Mailbox(capacity)
        with self._lock:
            self._begin(key, history, lambda _, payload: mailbox.put(payload))
        return mailbox

    def collect(
        self,
        keys: Sequence[str],
        *,
        history: int = 0,
        capacity: int = 10_000,
        recover: bool = True,  # noqa: ARG002 - nothing is lost here
        pace_s: float = PACE_S,  # noqa: ARG002 - what comes is there at once
    ) -> Mailbox[Keyed]:
        """One subscription to many keys, whose messages come with their keys."""
        mailbox: Mailbox[Keyed] = Mailbox(capacity)
        with self._lock:
            for key in keys:
                self._begin(key, history, lambda kept_key, payload: mailbox.put((kept_key, payload)))
        return mailbox

    def _begin(self, expression: str, history: int, take: Callable[[str, bytes], None]) -> None:
        for kept_key, kept in self._kept.items():
            if matches(expression, kept_key):
                for payload in list(kept.payloads)[max(0, len(kept.payloads) - history) :]:
                    take(kept_key, payload)
        self._subscriptions.append((expression, take))

    def get(self, key: str) -> bytes | None:
        """Last message on a key; None if there was none."""
        with self._lock:
            kept = self._kept.get(key)
            return kept.payloads[-1] if kept is not None and kept.payloads else None

    def answer(self, key: str) -> Mailbox[Request]:
        """Questions that are asked on a key from now on; each is to be answered."""
        mailbox: Mailbox[Request] = Mailbox(REQUESTS)
        with self._lock:
            self._answerers.append((key, mailbox))
        return mailbox

    async def ask(self, key: str, payload: bytes = b"", *, timeout_s: float = 5.0) -> list[bytes]:
        """Answers to a question, and the last message of each key in it that has a publisher."""
        with self._lock:
            answers = [
                kept.payloads[-1] for kept_key, kept in self._kept.items() if kept.payloads and matches(key, kept_key)
            ]
            waiting = [mailbox for asked, mailbox in self._answerers if matches(key, asked) or matches(asked, key)]
        requests = [MemoryRequest(key, payload) for _ in waiting]
        for mailbox, request in zip(waiting, requests, strict=True):
            mailbox.put(request)
        if requests:
            done, late = await asyncio.wait([request.answered for request in requests], timeout=timeout_s)
            answers += [answer.result() for answer in done]
            for answer in late:
                answer.cancel()
        return answers

    def announce(self, key: str) -> None:
        """Add the key to `alive`."""
        self.alive.add(key)
        self._tell(Presence(key, is_alive=True))

    def watch(self, key: str) -> Mailbox[Presence]:
        """Services that are announced under a key expression: those that live now, then each change."""
        mailbox: Mailbox[Presence] = Mailbox(REQUESTS)
        self._watchers.append((key, mailbox))
        for alive in sorted(self.alive):
            if matches(key, alive):
                mailbox.put(Presence(alive, is_alive=True))
        return mailbox

    def _tell(self, presence: Presence) -> None:
        for expression, mailbox in self._watchers:
            if matches(expression, presence.key):
                mailbox.put(presence)

    @property
    def is_connected(self) -> bool:
        """Always true: everybody is in this process."""
        return True


class MemoryRequest:
    """Question on a `MemoryBus`."""

    def __init__(self, key: str, payload: bytes) -> None:
        self.key = key
        self.payload = payload
        self.answered: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()

    def reply(self, payload: bytes) -> None:
        """Answer it."""
        with contextlib.suppress(RuntimeError):  # the loop of who asked has ended
            self.answered.get_loop().call_soon_threadsafe(self._set, payload)

    def _set(self, payload: bytes) -> None:
        if not self.answered.done():
            self.answered.set_result(payload)


class MemoryPublisher:
    """Publisher on one key of a `MemoryBus`."""

    def __init__(self, bus: MemoryBus, key: str) -> None:
        self._bus = bus
        self._key = key

    def put(self, payload: bytes, weight: int = 1) -> None:
        """Send a message, which counts as `weight` kept ones."""
        self._bus.put(self._key, payload, weight)


@functools.lru_cache(maxsize=4096)
def matches(expression: str, key: str) -> bool:
    """Whether a key lies in a key expression: `*` is one chunk between slashes, `**` any number of them.

    Examples
    --------
    >>> matches("wetwell/*/sample", "wetwell/alpha/sample"), matches("wetwell/*", "wetwell/alpha/sample")
    (True, False)
    >>> matches("wetwell/**", "wetwell"), matches("**/sample", "wetwell/alpha/sample")
    (True, True)
    """
    return _chunks_match(expression.split("/"), key.split("/"))


def _chunks_match(expression: list[str], key: list[str]) -> bool:
    if not expression:
        return not key
    head, *rest = expression
    if head == "**":
        return any(_chunks_match(rest, key[skipped:]) for skipped in range(len(key) + 1))
    return bool(key) and head in ("*", key[0]) and _chunks_match(rest, key[1:])
