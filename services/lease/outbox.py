"""What an owner tells and keeps: into the ledger first, then out on the bus."""

import asyncio
import logging
import threading
import time
from collections import Counter
from collections.abc import Callable

from wetwell.protocols.bus.interface import Bus, Publisher, Request
from wetwell.protocols.errors import LinkError
from wetwell.services.lease.ledger import Entry, Inheritance, LeaseLostError, Ledger, Numbered, Told, new_stream
from wetwell.services.lease.tenure import Tenure

log = logging.getLogger(__name__)

TRY_AGAIN_S = 0.1


class Outbox:
    """An `Outlet` whose messages are in the ledger before they are sent; states and lines go with them.

    All that is given to it between two turns of the event loop is one transaction. What an owner before has told
    already is not told again: a message is left out, once, if the ledger has the same.

    Characteristics: buffered: what waits for the database, without a bound, as it ends with the lease · threads:
    `keep` from any, all else from the event loop.

    Parameters
    ----------
    bus : Bus
        On which messages are sent.
    ledger : Ledger
    inheritance : Inheritance
        What owners before have left.
    tenure : callable
        That of now.
    """

    def __init__(self, bus: Bus, ledger: Ledger, inheritance: Inheritance, tenure: Callable[[], Tenure]) -> None:
        self._bus = bus
        self._ledger = ledger
        self._inheritance = inheritance
        self._tenure = tenure
        self._loop = asyncio.get_running_loop()
        self._news = asyncio.Event()
        self._lock = threading.Lock()
        self._entry, self._after = Entry(), list[Callable[[], None]]()
        self._going: tuple[Entry, list[Callable[[], None]]] | None = None
        self._publishers: dict[str, Publisher] = {}
        self._history: dict[str, int] = {}
        self._ends: dict[str, int] = {}
        self._lines = inheritance.lines

    @property
    def is_connected(self) -> bool:
        """Whether messages can reach others now."""
        return self._bus.is_connected

    @property
    def last_line(self) -> str | None:
        """The last line that owners before have left."""
        return self._inheritance.last_line

    def publisher(self, key: str, *, history: int = 1) -> "OutboxPublisher":
        """Publisher on a key that goes on where owners before ended; what they had kept and not sent is sent now."""
        told = self._inheritance.told.get(key)
        if told is None:
            told = Told(new_stream())
            self._entry.streams[key] = told.sent.source
        publisher = self._bus.publisher(key, history=history, goes_on=told.sent)
        for payload in told.unsent:
            publisher.put(payload)
        end = told.sent.end + len(told.unsent)
        if told.unsent:
            self._entry.sent[key] = end
        self._publishers[key], self._history[key], self._ends[key] = publisher, history, end
        self._news.set()
        return OutboxPublisher(self, key, Counter((*told.sent.payloads, *told.unsent)))

    def put(self, key: str, payload: bytes) -> None:
        """Tell a message."""
        self._entry.messages.append(Numbered(key, self._ends[key], payload))
        self._ends[key] += 1
        self._news.set()

    def keep(self, part: str, content: bytes) -> None:
        """Keep a state."""
        with self._lock:
            self._entry.states[part] = content
        self._loop.call_soon_threadsafe(self._news.set)

    def kept(self, part: str) -> bytes | None:
        """The state that owners before have left."""
        return self._inheritance.states.get(part)

    def write_down(self, text: str) -> None:
        """Add a line."""
        self._entry.lines.append((self._lines, text))
        self._lines += 1
        self._news.set()

    def then(self, act: Callable[[], None]) -> None:
        """Do something when all that was given until now is kept."""
        self._after.append(act)
        self._news.set()

    async def run(self) -> None:
        """Keep and send what comes, for ever.

        Raises
        ------
        LeaseLostError
            If another owns the role by now: nothing more is kept or sent.
        """
        while await self._news.wait():
            self._news.clear()
            await self.flush()

    async def flush(self) -> None:
        """Keep and send what is there; a database that is away is waited for.

        Raises
        ------
        LeaseLostError
            If another owns the role by now: nothing more is kept or sent.
        """
        while self._going is not None or self._after or not self._entry.is_empty:
            if self._going is None:
                with self._lock:
                    self._going = self._entry, self._after
                    self._entry, self._after = Entry(), []
            entry, after = self._going
            await self._enter(entry)
            if self._tenure().is_over(time.monotonic()):  # frozen in between: the next owner sends it
                raise LeaseLostError("the lease was over before what it covered was sent")
            for key, number, payload in entry.messages:
                self._publishers[key].put(payload)
                self._entry.sent[key] = number + 1
            for act in after:
                act()
            self._going = None

    async def _enter(self, entry: Entry) -> None:
        is_told = False
        while True:
            try:
                return await self._ledger.enter(self._tenure().token, entry, self._history)
            except LinkError as error:
                if not is_told:
                    log.warning("%s; nothing is told until it is kept", error)
                is_told = True
            await asyncio.sleep(TRY_AGAIN_S)


class OutboxPublisher:
    """Publisher on one key of an outbox.

    Parameters
    ----------
    outbox : Outbox
    key : str
    known : Counter of bytes
        Messages that owners before have told.
    """

    def __init__(self, outbox: Outbox, key: str, known: Counter[bytes]) -> None:
        self._outbox = outbox
        self._key = key
        self._known = known

    def put(self, payload: bytes, weight: int = 1) -> None:  # noqa: ARG002 - each message counts as one
        """Tell a message, unless an owner before has."""
        if self._known[payload]:
            self._known[payload] -= 1
            return
        self._outbox.put(self._key, payload)


class OutboxPlace:
    """A `StatePlace` in the ledger.

    Parameters
    ----------
    outbox : Outbox
    part : str
        Name of the state.
    """

    def __init__(self, outbox: Outbox, part: str) -> None:
        self._outbox = outbox
        self._part = part

    def read(self) -> bytes | None:
        """What owners before have left."""
        return self._outbox.kept(self._part)

    def write(self, content: bytes) -> None:
        """Keep a state, with what was told before it."""
        self._outbox.keep(self._part, content)

    def put_aside(self) -> str:
        """Keep what is refused under another name, which is returned."""
        aside = f"{self._part}.refused"
        self._outbox.keep(aside, self._outbox.kept(self._part) or b"")
        return aside


class KeptRequest:
    """A question whose answer goes out when all is kept that its answer says.

    Parameters
    ----------
    request : Request
    outbox : Outbox
    """

    def __init__(self, request: Request, outbox: Outbox) -> None:
        self.key = request.key
        self.payload = request.payload
        self._request = request
        self._outbox = outbox

    def reply(self, payload: bytes) -> None:
        """Answer it, later."""
        self._outbox.then(lambda: self._request.reply(payload))
