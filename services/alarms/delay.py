"""On-delay and off-delay: a condition counts when it has held for long enough."""

from dataclasses import dataclass

from wetwell.protocols.timestamps import NS_PER_S

MAX_STEP_S = 60.0
"""Most that the time between two looks counts, so that a clock that is set does not use up a delay.

A time that lies back by no more was counted before, for the clock of a station that gathers its samples has run on
until they came; what lies further back is of a clock that was set.
"""


@dataclass
class Delay:
    """A condition behind its delays.

    Examples
    --------
    >>> delay = Delay()
    >>> [delay.update(wanted, time_ns * NS_PER_S, 10.0, 0.0)
    ...  for wanted, time_ns in ((True, 0), (True, 5), (True, 10), (False, 11))]
    [False, False, True, False]
    """

    is_active: bool = False
    held_s: float | None = None
    last_ns: int | None = None

    def update(self, wanted: bool, time_ns: int, on_s: float, off_s: float) -> bool:
        """Whether the condition counts now, after it was seen (`wanted`) or not at this time."""
        if wanted == self.is_active:
            self.held_s = None
            return self.is_active
        step_s = 0.0 if self.held_s is None or self.last_ns is None else (time_ns - self.last_ns) / NS_PER_S
        if self.held_s is None or not -MAX_STEP_S <= step_s < 0.0:
            self.last_ns = time_ns
        self.held_s = (self.held_s or 0.0) + min(max(step_s, 0.0), MAX_STEP_S)
        if self.held_s >= (on_s if wanted else off_s):
            self.is_active, self.held_s = wanted, None
        return self.is_active
