"""The messages of many publishers in their order, each once: what is missing is known and can be asked for."""

from collections import deque

from wetwell.protocols.bus.publisher_cache import Page, read_mark

LINES = 8
"""Lives of publishers on one key that are remembered."""
MOST_HELD = 10_000
"""Messages of one publisher that wait for one that is missing."""


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

    Characteristics: buffered: what waits for a message that is missing, up to `MOST_HELD` of each publisher · when
    full: goes on without it · threads: one.

    Parameters
    ----------
    history : int
        Messages before the first one that was heard of a publisher, which are wanted too.

    Attributes
    ----------
    ready : list of (str, bytes)
        Key and payload of what is to be passed on, in order. Whoever takes it empties it.
    wanted : dict
        Lines of which messages are missing that nobody has asked for, by their sources.
    lost : int
        Messages that were given up.
    """

    def __init__(self, history: int) -> None:
        self.ready: list[tuple[str, bytes]] = []
        self.wanted: dict[bytes, SourceStream] = {}
        self.lost = 0
        self._history = history
        self._lines: dict[bytes, SourceStream] = {}
        self._sources: dict[str, deque[bytes]] = {}

    def take(self, key: str, mark: bytes | None, payload: bytes) -> None:
        """Take a message as it comes. One without a mark is passed on at once."""
        known = None if mark is None else read_mark(mark)
        if known is None:
            self.ready.append((key, payload))
            return
        source, number = known
        line = self._lines.get(source)
        if line is None:
            line = self._begin(key, source, max(0, number - self._history))
        if number == line.next == line.end:
            line.next = line.end = number + 1
            line.is_begun = True
            self.ready.append((key, payload))
        elif number >= line.next:
            line.held[number] = payload
            line.end = max(line.end, number + 1)
            self._go_on(line)

    def take_tail(self, key: str, mark: bytes) -> None:
        """Take the number that the next message of a publisher will have."""
        if (known := read_mark(mark)) is not None:
            self._reaches(key, *known)

    def take_page(self, key: str, page: Page, *, is_from_next: bool) -> None:
        """Take messages that were asked for: from the next one of a line on, or the last one of a publisher."""
        line = self._reaches(key, page.source, page.end)
        if is_from_next:  # older ones are not kept any more
            self._skip(line, page.first)
        for number, payload in enumerate(page.payloads, page.first):
            if number >= line.next:
                line.held[number] = payload
        self._go_on(line)

    def is_replaced(self, line: SourceStream) -> bool:
        """Whether a later life of its publisher was heard: then nobody keeps the messages of this one any more."""
        return self._sources[line.key][-1] != line.source

    def give_up(self, line: SourceStream) -> None:
        """Go on without the messages that are missing now."""
        self._skip(line, min(line.held, default=line.end))
        self._go_on(line)

    def _reaches(self, key: str, source: bytes, end: int) -> SourceStream:
        """The line of a publisher that has sent messages up to a number."""
        line = self._lines.get(source) or self._begin(key, source, max(0, end - self._history))
        line.end = max(line.end, end)
        self._go_on(line)
        return line

    def _begin(self, key: str, source: bytes, begin: int) -> SourceStream:
        sources = self._sources.setdefault(key, deque())
        if len(sources) == LINES:
            oldest = sources.popleft()
            self.wanted.pop(oldest, None)
            line = self._lines.pop(oldest)
            self._skip(line, line.end)
        sources.append(source)
        line = self._lines[source] = SourceStream(key, source, begin)
        return line

    def _go_on(self, line: SourceStream) -> None:
        """Pass on what is complete; want what is not."""
        held = line.held
        while line.next in held:
            self.ready.append((line.key, held.pop(line.next)))
            line.next += 1
            line.is_begun = True
        if len(held) > MOST_HELD:
            self.give_up(line)
        elif not line.is_missing:
            self.wanted.pop(line.source, None)
        elif not line.is_asked:
            self.wanted[line.source] = line

    def _skip(self, line: SourceStream, to: int) -> None:
        """Pass on what is there before a number, and go on at it."""
        if to <= line.next:
            return
        there = sorted(number for number in line.held if number < to)
        for number in there:
            self.ready.append((line.key, line.held.pop(number)))
        if line.is_begun:  # what was before the first one belongs to the history
            self.lost += to - line.next - len(there)
        line.next = to
        line.end = max(line.end, to)
