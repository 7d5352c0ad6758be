"""On-delay and off-delay: a condition counts when it has held for long enough."""

from dataclasses import dataclass

from wetwell.protocols.stamps import NS_PER_S

MAX_STEP_S = 60.0
"""Most that the time between two looks counts, so that a clock that is set does not use up a delay."""


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
        step_s = 0.0 if self.last_ns is None else min(max((time_ns - self.last_ns) / NS_PER_S, 0.0), MAX_STEP_S)
        self.last_ns = time_ns
        if wanted == self.is_active:
            self.held_s = None
            return self.is_active
        self.held_s = 0.0 if self.held_s is None else self.held_s + step_s
        if self.held_s >= (on_s if wanted else off_s):
            self.is_active, self.held_s = wanted, None
        return self.is_active
