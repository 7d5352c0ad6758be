"""Adaptive limits of the attribution index: what it is in health, kept up with the last normal runs."""

from collections import deque
from typing import Any

import numpy as np

from wetwell.detector.baseline.model import Baseline
from wetwell.detector.runs.run import Segments
from wetwell.detector.statistics.robust import quantiles
from wetwell.detector.statistics.tangent import attribution_index
from wetwell.detector.verdict.evidence import index_figures

RUNS = 50
"""Normal runs that the limits rest on."""
OUTER_SHARE = 0.05
SYSTEM_BELOW = 0.4
PUMP_ABOVE = 0.6
"""The paper's fixed limits; the learnt ones never lie inside them."""


class ControlLimits:
    """Limits of the attribution index of one pump, and what the index says of a run.

    The index is that of the way from the learnt operating point to the segments of a run: the tangent residuals
    taken over the time since learning, so that a fault that has stopped growing still shows. Noise alone gives an
    index set by the slopes of the curves, so the limits come from healthy runs: the outer 5 % on each side, and
    never inside the paper's .4 and .6.

    Memory: `RUNS` numbers. Warm-up: the learning phase.
    """

    def __init__(self) -> None:
        self._healthy: deque[float] = deque(maxlen=RUNS)

    def add(self, segments: Segments, baseline: Baseline) -> None:
        """Take a normal run into account."""
        self._healthy.append(attribution_index(*baseline.shifts(segments).T))

    def limits(self) -> tuple[float, float]:
        """(system below, pump above)."""
        if not self._healthy:
            return SYSTEM_BELOW, PUMP_ABOVE
        low, high = quantiles(np.array(self._healthy), (OUTER_SHARE, 1.0 - OUTER_SHARE))
        return min(low, SYSTEM_BELOW), max(high, PUMP_ABOVE)

    def figures(self, segments: Segments, baseline: Baseline, rng: np.random.Generator) -> dict[str, Any]:
        """Index, its interval, the limits, and what the index alone says: "pump", "system" or nothing."""
        pump_m, system_m = baseline.shifts(segments).T
        figures = index_figures(pump_m, system_m, rng)
        low, high = self.limits()
        below, above = figures["interval"][1] < low, figures["interval"][0] > high
        return figures | {
            "limits": [round(low, 4), round(high, 4)],
            "says": "system" if below else "pump" if above else None,
        }
