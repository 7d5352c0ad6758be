"""Buffer between the threads of a link and one event loop."""

import asyncio
import contextlib
import threading
from collections import deque
from collections.abc import Sequence
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Messages that wait for one asyncio reader; a `Subscription` of every link.

    Characteristics: buffered: up to `capacity` messages · when full: drops the oldest and counts it in `dropped` ·
    threads: `put` and `extend` from any, `receive` from one task of one loop · a wake-up crosses to the loop only
    while the reader waits, so a burst costs one.

    Parameters
    ----------
    capacity : int
        Most messages that wait, >= 1.

    Raises
    ------
    ValueError
        If `capacity` is below one.

    Examples
    --------
    >>> mailbox: Mailbox[bytes] = Mailbox(capacity=2)
    >>> for payload in (b"1", b"2", b"3"):
    ...     mailbox.put(payload)
    >>> asyncio.run(mailbox.receive()), mailbox.dropped
    ([b'2', b'3'], 1)
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        self.dropped = 0
        self._capacity = capacity
        self._messages: deque[T] = deque(maxlen=capacity)
        self._reader: asyncio.Future[None] | None = None
        self._lock = threading.Lock()

    def put(self, message: T) -> None:
        """Add a message; never waits for the reader."""
        self.extend((message,))

    def extend(self, messages: Sequence[T]) -> None:
        """Add messages in their order; never waits for the reader."""
        with self._lock:
            self.dropped += max(0, len(self._messages) + len(messages) - self._capacity)
            self._messages.extend(messages)
            reader, self._reader = self._reader, None
        if reader is not None:
            with contextlib.suppress(RuntimeError):  # the loop has ended: nobody is left to wake
                reader.get_loop().call_soon_threadsafe(_wake, reader)

    async def receive(self) -> list[T]:
        """Wait until a message is there, then return all that are, oldest first.

        Lets other tasks run each time, even if messages are always there. Cancelling loses no message.

        Raises
        ------
        RuntimeError
            If another task waits already.
        """
        await asyncio.sleep(0)
        while True:
            with self._lock:
                if self._messages:
                    batch = list(self._messages)
                    self._messages.clear()
                    return batch
                if self._reader is not None and not self._reader.done():
                    raise RuntimeError("a mailbox has one reader, another task waits already")
                reader = self._reader = asyncio.get_running_loop().create_future()
            await reader


def _wake(reader: asyncio.Future[None]) -> None:
    if not reader.done():
        reader.set_result(None)
