"""The bus as the services see it. Links: `memory_link` (one process), `zenoh_link` (a network).

A key is a Zenoh key expression; in subscriptions `*` stands for one chunk between slashes.
"""

from typing import Protocol


class Publisher(Protocol):
    """Sends the messages of one key, and answers a `get` on it with the last one."""

    def put(self, payload: bytes) -> None:
        """Send a message. Never waits: a subscriber that cannot keep up loses messages, not the sender time."""


class Subscription(Protocol):
    """Messages of a key, waiting to be received by one event loop.

    Characteristics: buffered: up to `capacity` · when full: drops the oldest and counts it in `dropped` ·
    filled from any thread · a link that comes back goes on in the same subscription.
    """

    dropped: int

    async def receive(self) -> list[bytes]:
        """Wait until a message is there, then return all that are, oldest first."""


class Bus(Protocol):
    """A connection that publishes, subscribes and shows that a service lives."""

    def publisher(self, key: str, *, history: int = 1) -> Publisher:
        """Publisher on a key that keeps the last `history` messages for late joiners and for recovery of loss."""

    def subscribe(self, key: str, *, history: int = 0, capacity: int = 10_000) -> Subscription:
        """Subscription to a key expression, beginning with up to `history` kept messages."""

    def announce(self, key: str) -> None:
        """Show under a key that this service lives, until the connection ends."""

    @property
    def is_connected(self) -> bool:
        """Whether messages can reach others now."""
