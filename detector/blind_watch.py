"""A pump without head or frequency: nobody can tell it from its main, but whether it runs as it used to shows."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wetwell.detector.dispatch import advice
from wetwell.detector.gate import Frame
from wetwell.detector.robust import NORMAL_MEDIAN
from wetwell.detector.runs import SEGMENT_S, SEGMENT_SAMPLES, WARM_UP_S
from wetwell.protocols.stamps import NS_PER_S

WATCHED = ("flow_m3h", "head_m", "power_kw")
REFERENCE_SEGMENTS = 12
"""Five minutes of running: nothing is said before."""
MAX_REFERENCE_SEGMENTS = 144
"""An hour of running: from then on the reference never moves."""
RECENT_SEGMENTS = 3
ABNORMAL_SIGMAS = 4.0
ABNORMAL_SHARE = 0.02
"""Least share of its usual value by which a reading must be off."""


@dataclass(slots=True)
class BlindWatch:
    """Readings of one pump against what they were in its first hour of running, by the number of running pumps.

    Means over segments of 25 samples or 25 s. A reading is off where the median of the last three segments lies
    `ABNORMAL_SIGMAS` robust standard deviations and `ABNORMAL_SHARE` from the median of the reference. Segments that
    are off never enter the reference. A drive that changes its speed without saying so looks abnormal too.

    Memory: `MAX_REFERENCE_SEGMENTS` numbers for each reading and number of running pumps. Warm-up: five minutes.

    Attributes
    ----------
    off : dict
        Readings that are off, and by which share of their usual value.
    is_known : bool
        Whether there is a reference for what runs now.
    """

    running: int = 0
    settled_ns: int = 0
    begin_ns: int = 0
    last_ns: int = 0
    rows: list[tuple[float, ...]] = field(default_factory=list)
    recent: deque[tuple[float, ...]] = field(default_factory=lambda: deque(maxlen=RECENT_SEGMENTS))
    reference: dict[int, list[tuple[float, ...]]] = field(default_factory=dict)
    off: dict[str, float] = field(default_factory=dict)
    is_known: bool = False

    def evidence(self) -> dict[str, Any]:
        """What a verdict says of it; nothing without a reference."""
        if not self.is_known:
            return {}
        if not self.off:
            return {"abnormal": False}
        remark = ", ".join(f"{name} is {share:+.1%} from what it was" for name, share in self.off.items())
        return {"abnormal": True, "off": dict(self.off), "advice": advice("unknown", remark)}

    def update(self, frame: Frame, pump: int, running: tuple[bool, ...]) -> bool:
        """Take a frame in which the pump (from 0) runs into account; True where what is off has changed."""
        reading = frame.pumps[pump]
        if not math.isnan(reading.frequency_hz + reading.flow_m3h + reading.head_m):
            return False
        time_ns = frame.time_ns
        is_break = time_ns - self.last_ns > 1.5 * frame.gap_s * NS_PER_S
        self.last_ns = time_ns
        if is_break or sum(running) != self.running:
            self.running = sum(running)
            self.settled_ns = time_ns + int(WARM_UP_S * NS_PER_S)
            self.rows.clear()
            self.recent.clear()
            self.is_known = len(self.reference.get(self.running, [])) >= REFERENCE_SEGMENTS
        if time_ns < self.settled_ns:
            return False
        if not self.rows:
            self.begin_ns = time_ns
        self.rows.append((reading.flow_m3h, reading.head_m, reading.power_kw))
        if (
            len(self.rows) < SEGMENT_SAMPLES
            and time_ns - self.begin_ns + frame.gap_s * NS_PER_S < SEGMENT_S * NS_PER_S
        ):
            return False
        segment = tuple(float(np.mean(column)) for column in zip(*self.rows, strict=True))
        self.rows.clear()
        return self._take(segment)

    def _take(self, segment: tuple[float, ...]) -> bool:
        """Take a full segment; True where what is off has changed."""
        self.recent.append(segment)
        learnt = self.reference.setdefault(self.running, [])
        self.is_known = len(learnt) >= REFERENCE_SEGMENTS
        before = set(self.off)
        self.off = self._off(learnt) if self.is_known and len(self.recent) == RECENT_SEGMENTS else self.off
        if not self.off and len(learnt) < MAX_REFERENCE_SEGMENTS:
            learnt.append(segment)
        return set(self.off) != before

    def _off(self, learnt: list[tuple[float, ...]]) -> dict[str, float]:
        usual = np.array(learnt)
        middle = np.median(usual, axis=0)
        deviation = NORMAL_MEDIAN * np.median(np.abs(usual - middle), axis=0)
        shift = np.median(np.array(self.recent), axis=0) - middle
        limit = np.maximum(ABNORMAL_SIGMAS * deviation, ABNORMAL_SHARE * np.abs(middle))
        return {
            name: round(float(shift[column] / middle[column]), 4)
            for column, name in enumerate(WATCHED)
            if math.isfinite(shift[column]) and abs(shift[column]) > limit[column] > 0.0
        }
