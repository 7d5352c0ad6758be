"""What a run has shown: each change of state of each pump, kept for the summary at the end. Pure."""

from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S

MOST_CHANGES = 200
"""Of a run that goes on for days the last ones are told."""


class Story:
    """The changes of state of a station's pumps, in the order in which they were told.

    Attributes
    ----------
    changes : list of Verdict
        The first verdict of each stretch of one state of a pump; the last `MOST_CHANGES`.
    passed_over : int
        Earlier ones.
    """

    def __init__(self) -> None:
        self.changes: list[Verdict] = []
        self.passed_over = 0
        self._last: dict[int, Verdict] = {}
        self._first_ns: int | None = None

    def handle(self, verdict: Verdict) -> bool:
        """Take a verdict; whether the state of a pump that was known has changed by it."""
        last = self._last.get(verdict.pump)
        if last is not None and verdict.time < last.time:
            return False  # told again after a restart
        self._first_ns = verdict.time if self._first_ns is None else self._first_ns
        self._last[verdict.pump] = verdict
        if last is not None and last.state == verdict.state:
            return False
        self.changes.append(verdict)
        if len(self.changes) > MOST_CHANGES:
            del self.changes[0]
            self.passed_over += 1
        return last is not None

    @property
    def has_judged(self) -> bool:
        """Whether there is more to tell than that pumps were learnt."""
        return any(verdict.state != "learning" for verdict in self.changes)

    @property
    def length_s(self) -> float:
        """Time of the station from the first verdict to the last. [s]."""
        if self._first_ns is None:
            return 0.0
        return (max(verdict.time for verdict in self._last.values()) - self._first_ns) / NS_PER_S
