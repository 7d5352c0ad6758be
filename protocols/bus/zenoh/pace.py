"""How fast a bus declares its keys: no faster than its router takes them."""

import threading
import time
from typing import Any

import zenoh

from wetwell.protocols.bus.keys import PACE

MOST_OPEN = 512
"""Declarations after which the router is asked whether it has taken them. One that has much to read of some reads
nothing of others. Those it takes for dead after 10 s, though they have something to say."""
PATIENCE_S = 10.0
"""So long a router is waited for that does not say so."""
LOOK_S = 0.002
"""So often it is looked whether it has."""


class Pace:
    """Counts what the sessions of a bus declare, and says when to wait. Any thread may use it.

    A router answers who lives once it has taken what the session has declared before.
    """

    def __init__(self) -> None:
        self._open = 0
        self._answer: Any = None
        self._lock = threading.Lock()

    def count(self, session: zenoh.Session, declarations: int) -> None:
        """Count declarations that a session has made or is about to make."""
        with self._lock:
            self._open += declarations
            if self._open >= MOST_OPEN and self._answer is None:
                self._open = 0
                self._answer = session.liveliness().get(PACE, zenoh.handlers.FifoChannel(1), timeout=PATIENCE_S)

    @property
    def is_behind(self) -> bool:
        """Whether the router has yet to take what was counted when it was asked last."""
        with self._lock:
            if self._answer is None:
                return False
            try:
                while self._answer.try_recv() is not None:
                    pass
            except zenoh.ZError:  # it has answered
                self._answer = None
            return self._answer is not None

    def wait(self) -> None:
        """Return when it has."""
        while self.is_behind:
            time.sleep(LOOK_S)
