"""A pump without head or frequency: nobody can tell it from its main, but whether it runs as it used to shows."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from wetwell.detector.runs.run import SEGMENT_S, SEGMENT_SAMPLES
from wetwell.detector.statistics.robust import NORMAL_MEDIAN, median
from wetwell.detector.stream.gate import seconds_between
from wetwell.detector.stream.run_state import WARM_UP_S
from wetwell.detector.verdict.maintenance import advice
from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, FREQUENCY, HEAD, POWER, PUMP_METERS, PUMP_VALUES
from wetwell.protocols.timestamps import NS_PER_S

REFERENCE_SEGMENTS = 12
"""Five minutes of running: nothing is said before."""
MAX_REFERENCE_SEGMENTS = 144
"""An hour of running: from then on the reference never moves."""
RECENT_SEGMENTS = 3
WARM_UP_NS = int(WARM_UP_S * NS_PER_S)
ABNORMAL_SIGMAS = 4.0
ABNORMAL_SHARE = 0.02
"""Least share of its usual value by which a reading must be off."""


BLIND = np.dtype(
    [(name, np.int64) for name in ("running", "settled_ns", "begin_ns", "last_ns", "samples", "is_full", "is_apart")]
    + [(name, np.float64) for name in PUMP_METERS]
)
"""Of one pump: how many pumps run, sums over the segment that is being gathered, whether it is full, and whether it
is the first since the pump started, others did, or the stream broke."""


def new_blinds(pumps: int) -> npt.NDArray[np.void]:
    """State of the segments of so many pumps before the first sample."""
    return np.zeros(pumps, dtype=BLIND)


@compiled
def gather(blinds: Any, time_ns: int, gap_s: float, frame: Floats, pumps: Any) -> bool:
    """Gather the readings of pumps that run, are being learnt, and lack flow, head or frequency.

    Parameters
    ----------
    blinds : new_blinds(pumps)
    time_ns, gap_s, frame
        A sample that has passed the gate.
    pumps : (pumps,) records
        `is_running` and `is_learning` are read.

    Returns
    -------
    bool
        Whether there is a pump of which a segment is full.
    """
    running = 0
    for number in range(pumps.shape[0]):
        running += pumps[number]["is_running"] != 0
    any_full = False
    for number in range(pumps.shape[0]):
        blind, at = blinds[number], FIRST_PUMP + PUMP_VALUES * number
        blind["is_full"] = 0
        is_seen = not math.isnan(frame[at + FREQUENCY] + frame[at + FLOW] + frame[at + HEAD])
        if is_seen or not pumps[number]["is_running"] or not pumps[number]["is_learning"]:
            continue
        is_apart = gap_s == math.inf or seconds_between(blind["last_ns"], time_ns) > 1.5 * gap_s
        blind["last_ns"] = time_ns
        if is_apart or running != blind["running"]:
            blind["running"] = running
            blind["settled_ns"] = time_ns + WARM_UP_NS
            blind["samples"] = 0
            blind["is_apart"] = 1
        if time_ns < blind["settled_ns"]:
            continue
        if blind["samples"] == 0:
            blind["begin_ns"] = time_ns
            blind["flow_m3h"] = blind["head_m"] = blind["power_kw"] = 0.0
        blind["samples"] += 1
        blind["flow_m3h"] += frame[at + FLOW]
        blind["head_m"] += frame[at + HEAD]
        blind["power_kw"] += frame[at + POWER]
        lasts_s = seconds_between(blind["begin_ns"], time_ns) + gap_s
        blind["is_full"] = blind["samples"] >= SEGMENT_SAMPLES or lasts_s >= SEGMENT_S
        any_full = any_full or blind["is_full"] != 0
    return any_full


@dataclass(slots=True)
class BlindWatch:
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

    def take(self, gathered: Any) -> bool:
        """Take a full segment of `new_blinds`, which begins anew; True where what is off has changed."""
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
