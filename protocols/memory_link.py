"""Bus within one process: for `wetwell up` without a network, for replays and for tests."""

import functools
import threading
from collections import deque
from typing import Self

from wetwell.protocols.mailbox import Mailbox


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
        self._kept: dict[str, deque[bytes]] = {}
        self._subscriptions: list[tuple[str, Mailbox]] = []
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Forget what was announced, as if the process had left the network."""
        self.alive.clear()

    def publisher(self, key: str, *, history: int = 1) -> "MemoryPublisher":
        """Publisher on a key that keeps the last `history` messages for late joiners.

        Raises
        ------
        ValueError
            If `history` is below one.
        """
        if history < 1:
            raise ValueError(f"history must be at least 1, got {history} (key '{key}')")
        with self._lock:
            self._kept[key] = deque(self._kept.get(key, ()), maxlen=history)
        return MemoryPublisher(self, key)

    def put(self, key: str, payload: bytes) -> None:
        """Send a message on a key that has a publisher."""
        with self._lock:
            self._kept[key].append(payload)
            for expression, mailbox in self._subscriptions:
                if matches(expression, key):
                    mailbox.put(payload)

    def subscribe(self, key: str, *, history: int = 0, capacity: int = 10_000) -> Mailbox:
        """Subscription to a key expression, beginning with up to `history` kept messages of each key in it."""
        mailbox = Mailbox(capacity)
        with self._lock:
            for kept_key, kept in self._kept.items():
                if matches(key, kept_key):
                    for payload in list(kept)[max(0, len(kept) - history) :]:
                        mailbox.put(payload)
            self._subscriptions.append((key, mailbox))
        return mailbox

    def get(self, key: str) -> bytes | None:
        """Last message on a key; None if there was none."""
        with self._lock:
            kept = self._kept.get(key)
            return kept[-1] if kept else None

    def announce(self, key: str) -> None:
        """Add the key to `alive`."""
        self.alive.add(key)

    @property
    def is_connected(self) -> bool:
        """Always true: everybody is in this process."""
        return True


class MemoryPublisher:
    """Publisher on one key of a `MemoryBus`."""

    def __init__(self, bus: MemoryBus, key: str) -> None:
        self._bus = bus
        self._key = key

    def put(self, payload: bytes) -> None:
        """Send a message."""
        self._bus.put(self._key, payload)


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
