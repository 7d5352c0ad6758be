"""When publishers have to say which message was their last: each is looked at when that may be due, not before."""

import math
from collections import defaultdict, deque
from itertools import chain
from typing import Protocol

END_SLOT_S = 0.25
"""Publishers are looked at in groups of this length, at the end of it. [s]"""
TOLD_AT_ONCE = 20
"""Publishers that say in one look which message was their last; it costs more than a usual one."""


class Speaker(Protocol):
    """A publisher, from the side of who makes it say its end."""

    rests_until_s: float

    def settle(self, now_s: float) -> bool:
        """Say which message was the last, if it is time to; whether it was."""


class Ends:
    """Publishers by when they may have to say their end.

    A look at each of 24,000, four times a second, took a tenth of a core.

    Attributes
    ----------
    spoken : deque
        Those that have something to say and are not waited for; any thread may add to it.
    """

    def __init__(self) -> None:
        self.spoken: deque[Speaker] = deque()
        self._waiting: defaultdict[int, list[Speaker]] = defaultdict(list)

    def settle(self, now_s: float) -> None:
        """Let those say their end whose time has come, a few at once."""
        while self.spoken:
            self._await(self.spoken.popleft())
        told = 0
        for slot in sorted(slot for slot in self._waiting if slot * END_SLOT_S <= now_s):
            due = self._waiting.pop(slot)
            while due and told < TOLD_AT_ONCE:
                speaker = due.pop()
                told += speaker.rests_until_s <= now_s and speaker.settle(now_s)
                self._await(speaker)
            if due:  # the rest has its turn with the next looks, and is not walked over until then
                self._waiting[slot].extend(due)
                return

    def look_at_all(self) -> None:
        """Look at all of them the next time: their link was away."""
        self.spoken.extend(chain.from_iterable(self._waiting.values()))
        self._waiting.clear()

    def _await(self, speaker: Speaker) -> None:
        self._waiting[math.ceil(speaker.rests_until_s / END_SLOT_S)].append(speaker)
