"""The messages of many publishers in their order, each once: what is missing is known and can be asked for."""

from collections import deque

from wetwell.protocols.bus.publisher_cache import Page, read_sequence_header

MOST_STREAMS = 8
"""Lives of publishers on one key that are remembered."""
MOST_HELD = 10_000
"""Messages of one publisher that wait for one that is missing."""
MOST_HELD_BYTES = 64 * 1024 * 1024
"""Of all messages that wait for missing ones."""


class SourceStream:
    """One life of one publisher: how far its messages have been passed on, and those that wait for earlier ones."""

    __slots__ = ("end", "held", "is_asked", "is_begun", "key", "next", "source", "tries")

    def __init__(self, key: str, source: bytes, begin: int) -> None:
        self.key = key
        self.source = source
        self.next = self.end = begin
        self.held: dict[int, bytes] = {}
        self.is_begun = False
        self.is_asked = False
        self.tries = 0

    @property
    def is_missing(self) -> bool:
        """Whether messages are there that have not come."""
        return self.next < self.end


class Sequencer:
    """Puts what comes in order. It knows no clock and no network: who uses it asks for what is `wanted`.

    Characteristics: buffered: what waits for a message that is missing, up to `MOST_HELD` of each publisher and
    `MOST_HELD_BYTES` of all · when full: what comes is let go, and asked for again when those before it are there ·
    threads: one.

    Parameters
    ----------
    history : int
        Messages before the first one that was heard of a publisher, which are wanted too.

    Attributes
    ----------
    ready : list of (str, bytes)
        Key and payload of what is to be passed on, in order. Whoever takes it empties it.
    wanted : dict
        Streams of which messages are missing that nobody has asked for, by their sources.
    lost : int
        Messages that were given up.
    """

    def __init__(self, history: int) -> None:
        self.ready: list[tuple[str, bytes]] = []
        self.wanted: dict[bytes, SourceStream] = {}
        self.lost = 0
        self._history = history
        self._held_bytes = 0
        self._streams: dict[bytes, SourceStream] = {}
        self._sources: dict[str, deque[bytes]] = {}

    def handle_message(self, key: str, header: bytes | None, payload: bytes) -> None:
        """Take a message as it comes. One without a sequence header is passed on at once."""
        known = None if header is None else read_sequence_header(header)
        if known is None:
            self.ready.append((key, payload))
            return
        source, number = known
        stream = self._streams.get(source)
        if stream is None:
            stream = self._begin(key, source, max(0, number - self._history))
        if number == stream.next == stream.end:
            stream.next = stream.end = number + 1
            stream.is_begun = True
            self.ready.append((key, payload))
        elif number >= stream.next:
            stream.end = max(stream.end, number + 1)
            self._hold(stream, number, payload)
            self._go_on(stream)

    def let_go(self, key: str, header: bytes) -> bool:
        """Want a message that is there, without taking it; whether its header says which it is."""
        known = read_sequence_header(header)
        if known is None:
            return False
        source, number = known
        self._reaches(key, source, number + 1)
        return True

    def handle_tail(self, key: str, header: bytes) -> None:
        """Take the number that the next message of a publisher will have."""
        if (known := read_sequence_header(header)) is not None:
            self._reaches(key, *known)

    def handle_page(self, key: str, page: Page, *, is_from_next: bool) -> None:
        """Take messages that were asked for: from the next one of a stream on, or the last one of a publisher."""
        stream = self._reaches(key, page.source, page.end)
        if is_from_next:  # older ones are not kept any more
            self._skip(stream, page.first)
        for number, payload in enumerate(page.payloads, page.first):
            if number >= stream.next:
                self._hold(stream, number, payload)
                self._go_on(stream)
        self._go_on(stream)

    def is_replaced(self, stream: SourceStream) -> bool:
        """Whether a later life of its publisher was heard: then nobody keeps the messages of this one any more."""
        return self._sources[stream.key][-1] != stream.source

    def give_up(self, stream: SourceStream) -> None:
        """Go on without the messages that are missing now."""
        self._skip(stream, min(stream.held, default=stream.end))
        self._go_on(stream)

    def _reaches(self, key: str, source: bytes, end: int) -> SourceStream:
        """The stream of a publisher that has sent messages up to a number."""
        stream = self._streams.get(source) or self._begin(key, source, max(0, end - self._history))
        stream.end = max(stream.end, end)
        self._go_on(stream)
        return stream

    def _begin(self, key: str, source: bytes, begin: int) -> SourceStream:
        sources = self._sources.setdefault(key, deque())
        if len(sources) == MOST_STREAMS:
            oldest = sources.popleft()
            self.wanted.pop(oldest, None)
            stream = self._streams.pop(oldest)
            self._skip(stream, stream.end)
        sources.append(source)
        stream = self._streams[source] = SourceStream(key, source, begin)
        return stream

    def _hold(self, stream: SourceStream, number: int, payload: bytes) -> None:
        """Let a message wait for earlier ones, where there is room; the next one always has."""
        is_full = len(stream.held) >= MOST_HELD or self._held_bytes + len(payload) > MOST_HELD_BYTES
        if number not in stream.held and (number == stream.next or not is_full):
            stream.held[number] = payload
            self._held_bytes += len(payload)

    def _release(self, stream: SourceStream, number: int) -> bytes:
        payload = stream.held.pop(number)
        self._held_bytes -= len(payload)
        return payload

    def _go_on(self, stream: SourceStream) -> None:
        """Pass on what is complete; want what is not."""
        while stream.next in stream.held:
            self.ready.append((stream.key, self._release(stream, stream.next)))
            stream.next += 1
            stream.is_begun = True
        if not stream.is_missing:
            self.wanted.pop(stream.source, None)
        elif not stream.is_asked:
            self.wanted[stream.source] = stream

    def _skip(self, stream: SourceStream, to: int) -> None:
        """Pass on what is there before a number, and go on at it."""
        if to <= stream.next:
            return
        there = sorted(number for number in stream.held if number < to)
        for number in there:
            self.ready.append((stream.key, self._release(stream, number)))
        if stream.is_begun:  # what was before the first one belongs to the history
            self.lost += to - stream.next - len(there)
        stream.next = to
        stream.end = max(stream.end, to)
