"""The last verdicts of each pump: who goes on from a checkpoint tells them again, as nobody may have heard them."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from wetwell.protocols.messages.verdict import Verdict

TOLD_AGAIN = 10
"""Of each pump: six hours of one that runs twice an hour. Each takes 1.7 kB of every checkpoint."""
LIVES_UNPROVEN = 10
"""So many lives of a detector, one after another, may end before it is known what was heard of them."""


class _Said(NamedTuple):
    """A verdict as it was told, when, and its place among all of the station."""

    number: int
    time_ns: int
    payload: bytes


class RecentVerdicts:
    """The last verdicts of each pump of a station, and from when on older ones are kept no more.

    Parameters
    ----------
    given_up : mapping, optional
        Of each pump times of verdicts that lives before have kept no longer, which may have been heard or not.
    """

    def __init__(self, given_up: Mapping[int, Sequence[int]] | None = None) -> None:
        self._said: dict[int, deque[_Said]] = {}
        self._given_up_ns: dict[int, int] = {}
        self._count = 0
        self.unproven = {pump: list(times_ns) for pump, times_ns in (given_up or {}).items()}
        """Of each pump the times of which somebody has yet to find out whether that verdict was heard."""

    def add(self, verdict: Verdict, payload: bytes) -> None:
        """Keep a verdict in place of the oldest of its pump; one that is told once more is kept already."""
        said = self._said.setdefault(verdict.pump, deque())
        if any(one.payload == payload for one in said):
            return
        self._count += 1
        said.append(_Said(self._count, verdict.time, payload))
        if len(said) > TOLD_AGAIN:
            self._given_up_ns[verdict.pump] = said.popleft().time_ns

    def payloads(self) -> list[bytes]:
        """All that are kept as they were told, in that order."""
        return [one.payload for one in sorted(one for of_pump in self._said.values() for one in of_pump)]

    def given_up(self) -> dict[int, list[int]]:
        """Of each pump the time of the last verdict that is kept no more, behind those that are unproven."""
        times_ns = {pump: list(unproven) for pump, unproven in self.unproven.items() if unproven}
        for pump, time_ns in self._given_up_ns.items():
            times_ns[pump] = [*times_ns.get(pump, []), time_ns][-LIVES_UNPROVEN:]
        return times_ns
