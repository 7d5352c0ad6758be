"""How fast the plant runs: which of its seconds are due on the wall clock, at a speed that may change."""

MAX_CATCH_UP_S = 3600
"""Most seconds of a station that one tick brings; what is due beyond them comes with the next ticks."""
LOOK_SPEED = 60.0
"""A minute of the plant in a second on the wall: one sees its pumps start and stop, and its verdicts one by one."""
ROUNDING_S = 1e-6


class Pace:
    """The clock of a plant against that of the wall. Pure; the time on the wall is an argument.

    Parameters
    ----------
    speed : float
        Seconds of the plant in a second on the wall, and the most that may be ordered.
    now_s : float
        Time on the wall. [s]
    is_held : bool
        Whether it stands until it is released.

    Examples
    --------
    >>> pace = Pace(600.0, now_s=0.0)
    >>> pace.take_due(0.0), pace.take_due(0.05)
    (1, 30)
    >>> pace.hold(0.05)
    >>> pace.take_due(9.0)
    0
    >>> pace.release(9.0)
    >>> pace.take_due(9.05)
    30
    """

    def __init__(self, speed: float, now_s: float, *, is_held: bool = False) -> None:
        self.full_speed = speed
        self.is_held = is_held
        self._set_speed = speed
        self._now_s = now_s
        self._look_until_s = now_s
        self._due_s = 1.0  # the first second comes at once

    @property
    def speed(self) -> float:
        """Speed now, were it not held."""
        return min(self._set_speed, LOOK_SPEED) if self._now_s < self._look_until_s else self._set_speed

    def hold(self, now_s: float) -> None:
        """Let the plant stand."""
        self._pass_until(now_s)
        self.is_held = True

    def release(self, now_s: float) -> None:
        """Let the plant go on."""
        self._pass_until(now_s)
        self.is_held = False

    def set_speed(self, now_s: float, speed: float) -> None:
        """Let the plant run at another speed, at most the full one; a look that goes on ends."""
        self._pass_until(now_s)
        self._set_speed = min(speed, self.full_speed)
        self._look_until_s = now_s

    def look(self, now_s: float, look_s: float) -> None:
        """Run no faster than `LOOK_SPEED` for so long from now on; a longer look that goes on stays. [s]."""
        self._pass_until(now_s)
        if not self.is_held:
            self._look_until_s = max(self._look_until_s, now_s + look_s)

    def take_due(self, now_s: float) -> int:
        """Seconds of the plant that are due and were not yet taken, at most `MAX_CATCH_UP_S`."""
        self._pass_until(now_s)
        if self.is_held:
            return 0
        due = min(int(self._due_s + ROUNDING_S), MAX_CATCH_UP_S)
        self._due_s -= due
        return due

    def _pass_until(self, now_s: float) -> None:
        if not self.is_held:
            looked_s = min(max(self._look_until_s - self._now_s, 0.0), now_s - self._now_s)
            self._due_s += looked_s * min(self._set_speed, LOOK_SPEED)
            self._due_s += (now_s - self._now_s - looked_s) * self._set_speed
        self._now_s = now_s
