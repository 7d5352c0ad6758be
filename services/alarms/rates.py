"""How many alarms call the operator, on the wall clock: rates, peak and flood after ISA-18.2 and EEMUA 191."""

from collections import deque
from collections.abc import Iterable

from wetwell.protocols.timestamps import NS_PER_S

WINDOW_S = 600
DAY_S = 86_400
FLOOD_BEGINS = 10
"""More calls than this in ten minutes are a flood."""
FLOOD_ENDS = 5
"""Fewer calls than this in ten minutes end it."""
MAX_CALLS = 5_000
"""Calls that are remembered at most; a day of them is needed."""


class AlarmRates:
    """Times at which alarms have called, for one day.

    Examples
    --------
    >>> rates = AlarmRates()
    >>> for second in range(11):
    ...     rates.add(second * NS_PER_S)
    >>> figures = rates.figures(20 * NS_PER_S)
    >>> figures["alarms_10min"], figures["peak_10min"], figures["is_flood"]
    (11.0, 11.0, 1.0)
    """

    def __init__(self, calls_ns: Iterable[int] = (), *, is_flood: bool = False) -> None:
        self._calls_ns: deque[int] = deque(calls_ns, maxlen=MAX_CALLS)
        self.is_flood = is_flood

    @property
    def calls_ns(self) -> list[int]:
        """Times of the calls that are remembered, oldest first."""
        return list(self._calls_ns)

    def add(self, now_ns: int) -> None:
        """Count a call."""
        self._calls_ns.append(now_ns)

    def look(self, now_ns: int) -> bool:
        """Forget what is older than a day; whether a flood has begun or ended."""
        while self._calls_ns and self._calls_ns[0] <= now_ns - DAY_S * NS_PER_S:
            self._calls_ns.popleft()
        recent = self._since(now_ns, WINDOW_S)
        was_flood = self.is_flood
        self.is_flood = recent >= FLOOD_ENDS if was_flood else recent > FLOOD_BEGINS
        return self.is_flood != was_flood

    def figures(self, now_ns: int) -> dict[str, float]:
        """Calls in ten minutes, an hour, a day; most in any ten minutes; share of the day's ten minutes in flood.

        The target of ISA-18.2 for one operator is about one call in ten minutes, at most two; 150 to 300 a day; at
        most ten in any ten minutes, and less than one percent of ten minutes with more.
        """
        self.look(now_ns)
        counts: dict[int, int] = {}
        for call_ns in self._calls_ns:
            slot = call_ns // (WINDOW_S * NS_PER_S)
            counts[slot] = counts.get(slot, 0) + 1
        floods = sum(count > FLOOD_BEGINS for count in counts.values())
        return {
            "alarms_10min": float(self._since(now_ns, WINDOW_S)),
            "alarms_hour": float(self._since(now_ns, 3600)),
            "alarms_day": float(len(self._calls_ns)),
            "peak_10min": float(self._peak()),
            "flood_share": floods / (DAY_S // WINDOW_S),
            "is_flood": float(self.is_flood),
        }

    def _since(self, now_ns: int, seconds: int) -> int:
        count = 0
        for call_ns in reversed(self._calls_ns):
            if call_ns <= now_ns - seconds * NS_PER_S:
                break
            count += 1
        return count

    def _peak(self) -> int:
        """Most calls in any ten minutes, wherever they begin."""
        window: deque[int] = deque()
        peak = 0
        for call_ns in self._calls_ns:
            window.append(call_ns)
            while window[0] <= call_ns - WINDOW_S * NS_PER_S:
                window.popleft()
            peak = max(peak, len(window))
        return peak
