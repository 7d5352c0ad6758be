"""What a publisher keeps of its messages, numbered, for those who come late or have lost some, and how they ask."""

import secrets
import struct
import threading
from collections import deque
from itertools import accumulate, islice, pairwise
from typing import Literal, NamedTuple

from pydantic import Field, ValidationError

from wetwell.protocols.bus.interface import KeptStream
from wetwell.protocols.messages.message import Message

SOURCE_BYTES = 8
PAGE_BYTES = 65_536
"""Messages of one answer; one message at least."""
KEPT_BYTES = 64 * 1024 * 1024
"""Messages that one publisher keeps at most; one message at least."""

_HEADER = struct.Struct(f">{SOURCE_BYTES}sQ")
_PAGE = struct.Struct(f">{SOURCE_BYTES}sQQ")


class CacheQuery(Message):
    """Question on the key of a publisher for what it keeps; without `source` for its last message."""

    schema_name: Literal["wetwell.kept-query/1"] = Field("wetwell.kept-query/1", alias="schema")
    source: str = Field("", max_length=2 * SOURCE_BYTES)
    begin: int = Field(0, ge=0, lt=2**63)


class Page(NamedTuple):
    """Messages of one publisher without a gap.

    Attributes
    ----------
    source : bytes
        Of which life of which publisher.
    first : int
        Number of the first of `payloads`; where there are none, of the next message.
    end : int
        Number that the publisher's next message will have.
    """

    source: bytes
    first: int
    end: int
    payloads: tuple[bytes, ...]

    def encode(self) -> tuple[bytes, bytes]:
        """Body, the messages one after the other, and head, which says where each ends."""
        sizes = [len(payload) for payload in self.payloads]
        return b"".join(self.payloads), _PAGE.pack(*self[:3]) + struct.pack(f">{len(sizes)}I", *sizes)

    @classmethod
    def decode(cls, body: bytes, head: bytes) -> "Page | None":
        """Page in an answer; None if it is none.

        Examples
        --------
        >>> page = Page(b"8 bytes.", 7, 9, (b"seven", b"eight"))
        >>> Page.decode(*page.encode()) == page, Page.decode(b"seven", b"")
        (True, None)
        """
        if len(head) < _PAGE.size or len(head) % 4:
            return None
        source, first, end = _PAGE.unpack_from(head)
        sizes = struct.unpack_from(f">{(len(head) - _PAGE.size) // 4}I", head, _PAGE.size)
        ends = list(accumulate(sizes, initial=0))
        if ends[-1] != len(body) or first + len(sizes) > end:
            return None
        payloads = tuple(body[begin:stop] for begin, stop in pairwise(ends))
        return cls(source, first, end, payloads)


class PublisherCache:
    """What one publisher keeps. Its `source` is new with each life, its numbers count up from 0, unless it goes on.

    Parameters
    ----------
    history : int
        Most messages that are kept, >= 1, up to `KEPT_BYTES`; one that holds many things counts as many. The last one
        is always kept.
    goes_on : KeptStream, optional
        What was sent before on the same key, by others.
    """

    def __init__(self, history: int, goes_on: KeptStream | None = None) -> None:
        self.source = secrets.token_bytes(SOURCE_BYTES)
        self.end = 0
        self._history = history
        self._payloads: deque[bytes] = deque()
        self._weights: deque[int] = deque()
        self._weight = self._bytes = 0
        self._lock = threading.Lock()
        if goes_on is not None:
            self.source, self.end = goes_on.source, goes_on.end - len(goes_on.payloads)
            for payload in goes_on.payloads:
                self.add(payload)

    def add(self, payload: bytes, weight: int = 1) -> bytes:
        """Keep a message that counts as so many; the sequence header that goes with it."""
        with self._lock:
            header = self.next_header
            self._payloads.append(payload)
            self._weights.append(weight)
            self._weight += weight
            self._bytes += len(payload)
            while (self._weight > self._history or self._bytes > KEPT_BYTES) and len(self._payloads) > 1:
                self._bytes -= len(self._payloads.popleft())
                self._weight -= self._weights.popleft()
            self.end += 1
        return header

    @property
    def last(self) -> bytes | None:
        """The last message; None before the first."""
        with self._lock:
            return self._payloads[-1] if self._payloads else None

    @property
    def next_header(self) -> bytes:
        """Sequence header of the next message."""
        return _HEADER.pack(self.source, self.end)

    def page(self, query: CacheQuery) -> Page | None:
        """What a question asks for, as far as it is kept and fits; None if it is for another one, or all is new."""
        if self.end == 0 or query.source not in ("", self.source.hex()):
            return None
        with self._lock:
            kept = len(self._payloads)
            begin = query.begin if query.source else self.end - 1
            first = min(max(begin, self.end - kept), self.end)
            payloads: list[bytes] = []
            room = PAGE_BYTES
            for payload in islice(self._payloads, first - (self.end - kept), None):
                room -= len(payload)
                if payloads and room < 0:
                    break
                payloads.append(payload)
            return Page(self.source, first, self.end, tuple(payloads))


def read_sequence_header(header: bytes) -> tuple[bytes, int] | None:
    """Source and number that go with a message; None if there are none, as of a publisher not of this package.

    Examples
    --------
    >>> cache = PublisherCache(history=2)
    >>> read_sequence_header(cache.add(b"{}")) == (cache.source, 0), read_sequence_header(b"?")
    (True, None)
    """
    if len(header) != _HEADER.size:
        return None
    source, number = _HEADER.unpack(header)
    return source, number


def read_query(payload: bytes) -> CacheQuery | None:
    """Question for what is kept; None if it is none."""
    try:
        return CacheQuery.model_validate_json(payload)
    except ValidationError:
        return None
