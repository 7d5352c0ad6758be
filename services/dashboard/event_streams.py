"""Server-sent events to many browsers: each is made once; a browser that cannot keep up begins anew."""

import asyncio
from collections import defaultdict
from collections.abc import AsyncGenerator, AsyncIterator

QUEUE = 16
"""Events that may wait for a browser."""
RESYNC = b"retry: 1000\nevent: resync\ndata: {}\n\n"
"""Tells a browser to ask for the whole state: at the beginning, and when it lacks something."""
KEEP_ALIVE = b": \n\n"
KEEP_ALIVE_S = 15.0


def event(data: str) -> bytes:
    r"""Bytes of an event.

    Examples
    --------
    >>> event('{"id":1}')
    b'data: {"id":1}\n\n'
    """
    return f"data: {data}\n\n".encode()


class Client:
    """Events that wait for one browser.

    Characteristics: buffered: up to `QUEUE` events · when full: all are dropped for one `RESYNC` · ends when closed.
    """

    def __init__(self) -> None:
        self._events: asyncio.Queue[bytes | None] = asyncio.Queue()
        self._events.put_nowait(RESYNC)

    def put(self, data: bytes) -> None:
        """Add an event; never waits."""
        if self._events.qsize() >= QUEUE:
            while not self._events.empty():
                self._events.get_nowait()
            data = RESYNC
        self._events.put_nowait(data)

    def close(self) -> None:
        """End the stream after what waits."""
        self._events.put_nowait(None)

    async def stream(self) -> AsyncIterator[bytes]:
        """Events until closed, and a comment now and then that keeps proxies from closing."""
        while True:
            try:
                data = await asyncio.wait_for(self._events.get(), KEEP_ALIVE_S)
            except TimeoutError:
                data = KEEP_ALIVE
            if data is None:
                return
            yield data


class EventStreams:
    """Browsers by the topic that they look at: `""` is the overview, else a station."""

    def __init__(self) -> None:
        self.is_closed = False
        self._clients: dict[str, set[Client]] = defaultdict(set)

    @property
    def clients(self) -> int:
        """How many browsers listen."""
        return sum(len(clients) for clients in self._clients.values())

    @property
    def topics(self) -> tuple[str, ...]:
        """What somebody looks at."""
        return tuple(self._clients)

    async def listen(self, topic: str) -> AsyncGenerator[bytes]:
        """Events of a topic for one browser, until it goes or all are closed."""
        client = Client()
        if self.is_closed:
            return
        self._clients[topic].add(client)
        try:
            async for data in client.stream():
                yield data
        finally:
            self._clients[topic].discard(client)
            if not self._clients[topic]:
                del self._clients[topic]

    def send(self, topic: str, data: str) -> None:
        """Send an event to all that look at a topic."""
        clients = self._clients.get(topic)
        if clients:
            encoded = event(data)
            for client in clients:
                client.put(encoded)

    def resync(self, topic: str) -> None:
        """Let all that look at a topic ask for its whole state."""
        for client in self._clients.get(topic, ()):
            client.put(RESYNC)

    def close(self) -> None:
        """End all streams."""
        self.is_closed = True
        for clients in self._clients.values():
            for client in clients:
                client.close()
