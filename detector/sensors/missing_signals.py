"""A pump without flow or frequency: nobody can tell it from its main, but whether it runs as it used to shows."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wetwell.detector.statistics.robust import NORMAL_MEDIAN, median
from wetwell.detector.verdict.maintenance import advice
from wetwell.protocols.quantities import PUMP_METERS

REFERENCE_SEGMENTS = 12
"""Five minutes of running: nothing is said before."""
MAX_REFERENCE_SEGMENTS = 144
"""An hour of running: from then on the reference never moves."""
RECENT_SEGMENTS = 3
ABNORMAL_SIGMAS = 4.0
ABNORMAL_SHARE = 0.02
"""Least share of its usual value by which a reading must be off."""


@dataclass(slots=True)
class MissingSignals:
    """Readings of one pump against what they were in its first hour of running, by the number of running pumps.

    Means over segments of 25 samples or 25 s. A reading is off where the median of the last three segments lies
    `ABNORMAL_SIGMAS` robust standard deviations and `ABNORMAL_SHARE` from the median of the reference. Segments that
    are off never enter the reference. A drive that changes its speed without saying so looks abnormal too.

    Memory: `MAX_REFERENCE_SEGMENTS` numbers for each reading and number of running pumps. Warm-up: five minutes.

    Attributes
    ----------
    recent : deque
        The last segments since the number of running pumps has changed.
    reference : dict
        The segments of the first hour, by the number of running pumps.
    off : dict
        Readings that are off, and by which share of their usual value.
    """

    recent: deque[tuple[float, ...]] = field(default_factory=lambda: deque(maxlen=RECENT_SEGMENTS))
    reference: dict[int, list[tuple[float, ...]]] = field(default_factory=dict)
    off: dict[str, float] = field(default_factory=dict)

    def evidence(self, running: int) -> dict[str, Any]:
        """What a verdict says of it while so many pumps run; nothing without a reference."""
        if len(self.reference.get(running, [])) < REFERENCE_SEGMENTS:
            return {}
        if not self.off:
            return {"abnormal": False}
        remark = ", ".join(f"{name} is {share:+.1%} from what it was" for name, share in self.off.items())
        return {"abnormal": True, "off": dict(self.off), "advice": advice("unknown", remark)}

    def update(self, gathered: Any) -> bool:
        """Compare a full segment of `new_missing_signals`, which begins anew; True where what is off has changed."""
        if gathered["is_apart"]:
            self.recent.clear()
        self.recent.append(tuple(float(gathered[name] / gathered["samples"]) for name in PUMP_METERS))
        gathered["is_apart"] = gathered["samples"] = 0
        learnt = self.reference.setdefault(int(gathered["running"]), [])
        before = set(self.off)
        if len(learnt) >= REFERENCE_SEGMENTS and len(self.recent) == RECENT_SEGMENTS:
            self.off = self._off(learnt)
        if not self.off and len(learnt) < MAX_REFERENCE_SEGMENTS:
            learnt.append(self.recent[-1])
        return set(self.off) != before

    def _off(self, learnt: list[tuple[float, ...]]) -> dict[str, float]:
        usual = np.array(learnt)
        middle = median(usual)
        deviation = NORMAL_MEDIAN * median(np.abs(usual - middle))
        shift = median(np.array(self.recent)) - middle
        limit = np.maximum(ABNORMAL_SIGMAS * deviation, ABNORMAL_SHARE * np.abs(middle))
        return {
            name: round(float(shift[column] / middle[column]), 4)
            for column, name in enumerate(PUMP_METERS)
            if math.isfinite(shift[column]) and abs(shift[column]) > limit[column] > 0.0
        }
