"""The sessions of a bus. Zenoh holds a declaration against all others of its session, so there are more of them."""

import contextlib
import threading
from collections.abc import Callable

import zenoh

from wetwell.protocols.bus.zenoh.pace import Pace
from wetwell.protocols.bus.zenoh.session import at_once
from wetwell.protocols.errors import LinkError

ROOM_OF_FIRST = 64
"""Declarations of the first session, which hears all stations: each message there is held against what it knows."""
ROOM_OF_FURTHER = 2_048
"""Declarations of each further one: a declaration costs some .1 µs for each before it."""
MOST_NUMBERS = 32_768
"""Of the numbers that Zenoh gives to the keys of a session: they have 16 bits, and it does not notice when they run
out."""


class Line:
    """A session, and how much it has declared.

    Attributes
    ----------
    session : zenoh.Session
    has_come_back : threading.Event
        Set when its router is there again.
    room : int
        Declarations that it may still take.
    """

    def __init__(self, session: zenoh.Session, most: int, pace: Pace) -> None:
        self.session = session
        self._pace = pace
        self.has_come_back = threading.Event()
        self.room = most
        self._numbers = 0
        self._listener = session.info.declare_transport_events_listener(
            at_once(self._handle_transport), history=False
        )

    def _handle_transport(self, event: zenoh.TransportEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            self.has_come_back.set()

    @property
    def is_connected(self) -> bool:
        """Whether it has its router."""
        return bool(self.session.info.routers_zid())

    def token(self, key: str) -> zenoh.LivelinessToken:
        """A token that makes its router know a key, for as long as it is held."""
        self._pace.count(self.session, 1)
        return self.session.liveliness().declare_token(key)

    def numbered(self, key: str) -> zenoh.KeyExpr:
        """The key, declared as long as there are numbers: then the session knows where its messages go.

        A message on another key is held against all keys that the session knows. A router knows the keys on which
        something subscribes, answers or lives; a publisher of Zenoh would make it known there, too, and let the
        router hold each later declaration of others against it.
        """
        self._numbers += 1
        return self.session.declare_keyexpr(key) if self._numbers <= MOST_NUMBERS else zenoh.KeyExpr(key)


class Sessions:
    """Sessions through one router, as many as the declarations need.

    Parameters
    ----------
    first : zenoh.Session
    further : callable or None
        Opens another one; None if there can be none, as in a router.
    """

    def __init__(self, first: zenoh.Session, further: Callable[[], zenoh.Session] | None = None) -> None:
        self._further = further
        self.pace = Pace()
        self.first = Line(first, ROOM_OF_FIRST, self.pace)
        self.lines = [self.first]
        self._apart: list[zenoh.Session] = []

    def with_room(self, declarations: int) -> Line:
        """A line for so many declarations more, which are counted; the last one if no other can be opened.

        It waits until the router has taken most of those before.
        """
        self.pace.wait()
        line = self.lines[-1]
        if line.room < declarations:
            further = self._opened()
            if further is None:
                line.room += ROOM_OF_FURTHER
            else:
                line = Line(further, ROOM_OF_FURTHER, self.pace)
                self.lines.append(line)
        line.room -= declarations
        self.pace.count(line.session, declarations)
        return line

    def apart(self) -> zenoh.Session:
        """A session for what makes many keys known, if one can be opened: no message is held against those."""
        session = self._opened()
        if session is None:
            return self.first.session
        self._apart.append(session)
        return session

    def _opened(self) -> zenoh.Session | None:
        """None in a router, and while there is none: nobody waits for one that is away."""
        if self._further is None or not self.first.is_connected:
            return None
        with contextlib.suppress(LinkError):
            return self._further()
        return None

    @property
    def is_closed(self) -> bool:
        """Whether they were closed."""
        return self.first.session.is_closed()

    @property
    def is_connected(self) -> bool:
        """Whether each of them has its router."""
        return all(line.is_connected for line in self.lines)

    def close(self) -> None:
        """Close all; twice is fine. A router too busy to hear of it sees that the connection has gone."""
        for session in [*(line.session for line in self.lines), *self._apart]:
            with contextlib.suppress(zenoh.ZError), session:
                pass
