"""The bus as the services see it; `wetwell.protocols.bus.zenoh` is the one over a network.

A key is a Zenoh key expression; in subscriptions `*` stands for one chunk between slashes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

T = TypeVar("T")

Keyed = tuple[str, bytes]
"""A message with its key."""

ALL_KEPT = 2**31
"""As the history of a subscription: all that each publisher keeps, however long that is."""

PACE_S = 0.005
"""How often a subscription is fed, where it does not say otherwise: a message waits for so long at most. [s]"""


class Publisher(Protocol):
    """Sends the messages of one key, and answers a `get` on it with the last one."""

    def put(self, payload: bytes, weight: int = 1) -> None:
        """Send a message. Never waits: a subscriber that cannot keep up loses messages, not the sender time.

        It counts as `weight` of those that are kept.
        """


@dataclass(frozen=True)
class KeptStream:
    """What publishers before have sent on a key, for one that goes on where they ended: numbers go on, too.

    Attributes
    ----------
    source : bytes
        8 bytes that tell this stream from all others on the key.
    end : int
        Number of the next message.
    payloads : tuple of bytes
        The last messages before it, oldest first.
    """

    source: bytes
    end: int
    payloads: tuple[bytes, ...] = ()


class Subscription(Protocol[T]):
    """Messages of a key, waiting to be received by one event loop.

    Characteristics: buffered: up to `capacity`, and a bound in bytes · when full: drops the oldest and counts it in
    `dropped`; one that recovers what is lost leaves it to the publisher until there is room · filled from any
    thread · a link that comes back goes on in the same subscription · `missed` counts what nobody has any more ·
    `is_behind` tells whether publishers keep messages that have yet to come.
    """

    dropped: int
    missed: int
    is_behind: bool

    async def receive(self) -> list[T]:
        """Wait until a message is there, then return all that are, oldest first."""


class Request(Protocol):
    """A question that somebody has asked on a key."""

    key: str
    payload: bytes

    def reply(self, payload: bytes) -> None:
        """Answer it, once, from any thread. Who asked may be gone: then nothing happens."""


@dataclass(frozen=True)
class Presence:
    """A service that has come (`is_alive`) or gone, by the key that it had announced."""

    key: str
    is_alive: bool


class Outlet(Protocol):
    """The side of a bus on which one publishes."""

    def publisher(self, key: str, *, history: int = 1) -> Publisher:
        """Publisher on a key that keeps the last `history` messages for late joiners and for recovery of loss."""

    @property
    def is_connected(self) -> bool:
        """Whether messages can reach others now."""


class Bus(Outlet, Protocol):
    """A connection that publishes, subscribes, asks and answers, and shows that a service lives."""

    def publisher(self, key: str, *, history: int = 1, goes_on: KeptStream | None = None) -> Publisher:
        """Publisher on a key that keeps the last `history` messages; with `goes_on` it continues others' stream."""

    def subscribe(
        self, key: str, *, history: int = 0, capacity: int = 10_000, recover: bool = True, pace_s: float = PACE_S
    ) -> Subscription[bytes]:
        """Subscription to a key expression, beginning with up to `history` kept messages of each publisher.

        The messages of one publisher come in their order, each once; what was lost on the way comes from what its
        publisher keeps. Without `recover`, and without `history`, it stays lost: for those who show the newest.
        What comes within `pace_s` is handed over together: who has no haste spares the processor. [s]
        """

    def collect(
        self,
        keys: Sequence[str],
        *,
        history: int = 0,
        capacity: int = 10_000,
        recover: bool = True,
        pace_s: float = PACE_S,
    ) -> Subscription[Keyed]:
        """One subscription to many keys, whose messages come with their keys."""

    def answer(self, key: str) -> Subscription[Request]:
        """Questions that are asked on a key from now on; each is to be answered."""

    async def ask(self, key: str, payload: bytes = b"", *, timeout_s: float = 5.0) -> list[bytes]:
        """Answers to a question; of a key with a publisher also its last message. None in time: an empty list."""

    def announce(self, key: str) -> None:
        """Show under a key that this service lives, until the connection ends."""

    def watch(self, key: str) -> Subscription[Presence]:
        """Services that are announced under a key expression: those that live now, then each change."""
