"""Meters that are stuck or noisy, told from the readings alone."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import numpy.typing as npt

from wetwell.detector.gate import Frame
from wetwell.detector.robust import NORMAL_MEDIAN
from wetwell.detector.runs import Run
from wetwell.protocols.stamps import NS_PER_S

Floats = npt.NDArray[np.float64]

STUCK_NS = 60 * NS_PER_S
STUCK_FACTOR = 5.0
"""A reading may repeat this many times as long as it ever did in the learning phase."""
NOISY_FACTOR = 3.0
MAX_GAP_S = 120.0
MIN_DIFFERENCES = 30
DIFFERENCE_MEDIAN = NORMAL_MEDIAN / math.sqrt(2.0)
"""Standard deviation of normal numbers over the median of the size of their differences."""


@cache
def _names(pump: int) -> tuple[str, str, str]:
    return f"pump{pump}_flow_m3h", f"pump{pump}_head_m", f"pump{pump}_power_kw"


@dataclass(slots=True)
class RepeatWatch:
    """Counts how long each reading other than 0 repeats itself exactly, in frames that follow one another.

    A feed that reports by exception, or in coarse steps, repeats itself in health: what the readings of a pump do
    while it is learnt is remembered, and what the level does while no pump is known.

    Memory: constant.
    """

    frame_ns: int = 0
    last: dict[str, float] = field(default_factory=dict)
    seen_ns: dict[str, int] = field(default_factory=dict)
    since_ns: dict[str, int] = field(default_factory=dict)
    longest_ns: dict[str, int] = field(default_factory=dict)
    stuck: set[str] = field(default_factory=set)

    def update(self, frame: Frame, running: Sequence[bool], is_learning: Sequence[bool]) -> None:
        """Take a frame into account: which pumps run, and which are in their learning phase."""
        self._note("level_m", frame.level_m, frame, all(is_learning))
        for index, pump in enumerate(frame.pumps):
            if not running[index] and pump.flow_m3h == 0.0:
                continue
            flow, head, power = _names(index + 1)
            if pump.flow_m3h != 0.0:
                self._note(flow, pump.flow_m3h, frame, is_learning[index])
            if running[index]:
                if pump.head_m != 0.0:
                    self._note(head, pump.head_m, frame, is_learning[index])
                if pump.power_kw != 0.0:
                    self._note(power, pump.power_kw, frame, is_learning[index])
        self.frame_ns = frame.time_ns

    def _note(self, name: str, value: float, frame: Frame, is_learning: bool) -> None:
        is_next = self.seen_ns.get(name) == self.frame_ns and frame.gap_s <= MAX_GAP_S
        self.seen_ns[name] = frame.time_ns
        if not is_next or value != self.last[name]:
            self.last[name] = value
            self.since_ns[name] = frame.time_ns
            self.stuck.discard(name)
            return
        lasts_ns = frame.time_ns - self.since_ns[name]
        if name in self.stuck:
            return
        if is_learning:
            self.longest_ns[name] = max(lasts_ns, self.longest_ns.get(name, 0))
        elif lasts_ns > max(STUCK_NS, STUCK_FACTOR * self.longest_ns.get(name, 0)):
            self.stuck.add(name)


def reading_noise(run: Run) -> Floats:
    """(2,) standard deviation of flow and head from second to second, as shares of their means; NaN if too short.

    From the median difference of neighbours: what changes slowly, or once, does not count.
    """
    if len(run.time_s) <= MIN_DIFFERENCES:
        return np.full(2, math.nan)
    is_next = np.diff(run.time_s) <= 1.5
    if np.count_nonzero(is_next) < MIN_DIFFERENCES:
        return np.full(2, math.nan)
    noise = [
        DIFFERENCE_MEDIAN * float(np.median(np.abs(np.diff(values)[is_next]))) / max(abs(float(values.mean())), 1e-9)
        for values in (run.flow_m3h, run.head_m)
    ]
    return np.array(noise)


def healthy_noise(noises: Sequence[Floats]) -> Floats:
    """(2,) median of the noise of healthy runs, NaN where it was never known."""
    known = np.array([noise for noise in noises if np.isfinite(noise).all()])
    return np.median(known, axis=0) if len(known) else np.full(2, math.nan)


def noisy_meters(run: Run, healthy: Floats) -> Mapping[str, float]:
    """Readings that are noisier than in health by more than `NOISY_FACTOR`, with that factor."""
    factors = reading_noise(run) / np.where(healthy > 0.0, healthy, math.nan)  # 0: the steps of the reading hide it
    return {
        name: round(float(factor), 1)
        for name, factor in zip(("flow_m3h", "head_m"), factors, strict=True)
        if factor > NOISY_FACTOR
    }
