"""Buffer between the threads of a link and one event loop."""

import asyncio
import contextlib
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

T = TypeVar("T")

MOST_BYTES = 128 * 1024 * 1024
"""Of the messages that wait in one mailbox, where their size is known: 200,000 samples of three pumps."""


class Mailbox(Generic[T]):
    """Messages that wait for one asyncio reader; a `Subscription` of every link.

    Characteristics: buffered: up to `capacity` messages and `most_bytes` · when full: drops the oldest and counts it
    in `dropped`, but never the newest · threads: `put` and `extend` from any, `receive` from one task of one loop · a
    wake-up crosses to the loop only while the reader waits, so a burst costs one.

    Parameters
    ----------
    capacity : int
        Most messages that wait, >= 1.
    size_bytes : callable, optional
        Size of a message; without it only their number counts.
    most_bytes : int
        Most bytes that wait, beside one message of any size.

    Attributes
    ----------
    dropped : int
        Messages for which there was no room.
    missed : int
        Messages that were lost on the way and that nobody has any more; the link counts them.
    is_behind : bool
        Whether publishers keep messages that have yet to come; the link tells it.

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

    def __init__(
        self, capacity: int, size_bytes: Callable[[T], int] | None = None, most_bytes: int = MOST_BYTES
    ) -> None:
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        self.dropped = 0
        self.missed = 0
        self.is_behind = False
        self._capacity = capacity
        self._size_bytes = size_bytes
        self._most_bytes = most_bytes
        self._bytes = 0
        self._messages: deque[T] = deque(maxlen=capacity if size_bytes is None else None)
        self._reader: asyncio.Future[None] | None = None
        self._lock = threading.Lock()

    @property
    def is_crowded(self) -> bool:
        """Whether half of the room is taken: a link that can have messages again later lets them go until then."""
        return len(self._messages) > self._capacity - self.half or 2 * self._bytes > self._most_bytes

    @property
    def half(self) -> int:
        """So many messages find room while it is not crowded, one at least."""
        return max(1, self._capacity // 2)

    def put(self, message: T) -> None:
        """Add a message; never waits for the reader."""
        self.extend((message,))

    def extend(self, messages: Sequence[T]) -> None:
        """Add messages in their order; never waits for the reader."""
        with self._lock:
            if self._size_bytes is None:
                self.dropped += max(0, len(self._messages) + len(messages) - self._capacity)
                self._messages.extend(messages)
            else:
                self._messages.extend(messages)
                self._bytes += sum(map(self._size_bytes, messages))
                while len(self._messages) > self._capacity or (
                    self._bytes > self._most_bytes and len(self._messages) > 1
                ):
                    self._bytes -= self._size_bytes(self._messages.popleft())
                    self.dropped += 1
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
                    self._bytes = 0
                    return batch
                if self._reader is not None and not self._reader.done():
                    raise RuntimeError("a mailbox has one reader, another task waits already")
                reader = self._reader = asyncio.get_running_loop().create_future()
            await reader


def _wake(reader: asyncio.Future[None]) -> None:
    if not reader.done():
        reader.set_result(None)
