"""The maintenance of a store, step by step: which station is looked at, and which has nothing to do."""

from collections.abc import Callable, Mapping, Sequence

from wetwell.services.historian.rows import HOUR_NS
from wetwell.services.historian.store.interface import DAY_NS, Store, day_of

LOOK_AGAIN_NS = HOUR_NS
"""A station is looked at so often at least: something may be missing that was there. [ns]"""

Step = Callable[[str, int], str | None]
"""Of a station and the beginning of its newest day: what was done, or None."""


class Upkeep:
    """Takes the first step that has something to do, and leaves stations alone at which nothing has become due.

    What becomes due does so with a new day, with samples of another day than the newest, or where something damaged
    was put aside. A look at a station costs a millisecond of the database.

    Parameters
    ----------
    store : Store
    steps : sequence of callable
    """

    def __init__(self, store: Store, steps: Sequence[Step]) -> None:
        self._store = store
        self._steps = steps
        self._quiet: dict[str, tuple[int, int]] = {}
        self._damages = 0

    def note(self, spans: Mapping[str, tuple[int, int]]) -> None:
        """Look again at stations of which samples of another day have come, by their first and last time."""
        for station, (first_ns, last_ns) in spans.items():
            day_ns = self._quiet.get(station, (first_ns, 0))[0]
            if first_ns < day_ns or last_ns >= day_ns + DAY_NS:
                self._quiet.pop(station, None)

    def one(self, now_ns: int) -> str | None:
        """Take one step; what was done, or None if there is nothing to do.

        Raises
        ------
        StoreError
            If the store cannot now.
        """
        if self._damages != self._store.damages:
            self._damages = self._store.damages
            self._quiet.clear()
        for name, _, last_ns in self._store.stations():
            day_ns = day_of(min(last_ns, now_ns))
            quiet_ns, looked_ns = self._quiet.get(name, (None, 0))
            if quiet_ns == day_ns and now_ns - looked_ns < LOOK_AGAIN_NS:
                continue
            self._quiet[name] = day_ns, now_ns  # before the look: what comes meanwhile is noted
            try:
                done = self._look(name, last_ns, now_ns)
            except BaseException:
                self._quiet.pop(name, None)
                raise
            if done is not None:
                self._quiet.pop(name, None)
                return done
        return None

    def _look(self, station: str, last_ns: int, now_ns: int) -> str | None:
        end_ns = self._store.newest_ns(station)
        newest_ns = day_of(min(last_ns if end_ns is None else end_ns, now_ns))
        return next((done for step in self._steps if (done := step(station, newest_ns)) is not None), None)
