"""Keys that a session has declared to Zenoh, so that it looks their way up once and not with each message."""

import zenoh

MOST_NUMBERS = 32_768
"""Of the numbers that Zenoh gives to declared keys: they have 16 bits, and it does not notice when they run out."""


class DeclaredNames:
    """Numbers of a session's keys.

    A message on a key that is not declared is held against all keys that the process knows: with a thousand stations
    that takes .05 to .2 ms, most of what a message costs. On a declared key Zenoh remembers where it goes.

    Parameters
    ----------
    session : zenoh.Session

    Notes
    -----
    `add` may be called from one thread, `take` from any.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._numbers = 0
        self._known: set[str] = set()
        self._declared: list[zenoh.KeyExpr] = []

    def take(self) -> bool:
        """Whether there is a number for one more key, which is counted as declared."""
        self._numbers += 1
        return self._numbers <= MOST_NUMBERS

    def note(self, key: str) -> None:
        """Count a key as known that a subscription has declared."""
        self._known.add(key)

    def add(self, key: str) -> None:
        """Declare a key on which a message has come, once, as long as there are numbers."""
        if key not in self._known and len(self._known) < MOST_NUMBERS:
            self._known.add(key)
            if self.take():
                self._declared.append(self._session.declare_keyexpr(key))
