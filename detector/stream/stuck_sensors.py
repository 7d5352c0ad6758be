"""Meters that are stuck or noisy, told from the readings alone."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.robust import NORMAL_MEDIAN, median
from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, LEVEL, PUMP_METERS, PUMP_VALUES, pump_column
from wetwell.protocols.timestamps import NS_PER_S

STUCK_NS = 60 * NS_PER_S
STUCK_FACTOR = 5.0
"""A reading may repeat this many times as long as it ever did in the learning phase."""
NOISY_FACTOR = 3.0
MAX_GAP_S = 120.0
MIN_DIFFERENCES = 30
DIFFERENCE_MEDIAN = NORMAL_MEDIAN / math.sqrt(2.0)
"""Standard deviation of normal numbers over the median of the size of their differences."""


"""Of a pump, watched beside the level."""
METER = np.dtype(
    [(name, np.int64) for name in ("is_followed", "is_stuck", "since_ns", "longest_ns")] + [("last", np.float64)]
)
"""Whether the frame before had a reading too, whether that is stuck, since when it repeats itself, how long it ever
did while it was learnt."""


def new_meters(pumps: int) -> npt.NDArray[np.void]:
    """State of the level and of three meters a pump."""
    return np.zeros(1 + len(PUMP_METERS) * pumps, dtype=METER)


def stuck_names(pump: int, bits: int) -> list[str]:
    """Names of the readings that were stuck in a run of a pump (from 0)."""
    names = ("level_m", *(pump_column(pump + 1, name) for name in PUMP_METERS))
    return sorted(name for bit, name in enumerate(names) if bits >> bit & 1)


@compiled
def _note(meter: Any, value: float, time_ns: int, gap_s: float, is_learning: bool) -> None:
    is_next = meter["is_followed"] and gap_s <= MAX_GAP_S
    meter["is_followed"] = 1
    if not is_next or value != meter["last"]:
        meter["last"] = value
        meter["since_ns"] = time_ns
        meter["is_stuck"] = 0
        return
    lasts_ns = time_ns - meter["since_ns"]
    if meter["is_stuck"]:
        return
    if is_learning:
        meter["longest_ns"] = max(lasts_ns, meter["longest_ns"])
    elif lasts_ns > max(STUCK_NS, STUCK_FACTOR * meter["longest_ns"]):
        meter["is_stuck"] = 1


@compiled
def watch_meters(meters: Any, time_ns: int, gap_s: float, frame: Floats, pumps: Any) -> None:
    """Note how long each reading other than 0 repeats itself exactly, in frames that follow one another.

    A feed that reports by exception, or in coarse steps, repeats itself in health: what the readings of a pump do
    while it is learnt is remembered, and what the level does while no pump is known.

    Parameters
    ----------
    meters : new_meters(pumps)
    time_ns, gap_s, frame
        A sample that has passed the gate.
    pumps : (pumps,) records
        `is_running` and `is_learning` are read; `stuck` gathers, while a pump runs, a bit for each that is stuck.
    """
    is_learning = True
    for pump in range(pumps.shape[0]):
        is_learning = is_learning and pumps[pump]["is_learning"] != 0
    _note(meters[0], frame[LEVEL], time_ns, gap_s, is_learning)
    for pump in range(pumps.shape[0]):
        state, at = pumps[pump], FIRST_PUMP + PUMP_VALUES * pump + FLOW
        for number in range(len(PUMP_METERS)):
            meter, value = meters[1 + len(PUMP_METERS) * pump + number], frame[at + number]
            if value != 0.0 and (state["is_running"] or number == 0):
                _note(meter, value, time_ns, gap_s, state["is_learning"] != 0)
            else:
                meter["is_followed"] = 0
        if state["is_running"]:
            bits = meters[0]["is_stuck"]
            for number in range(len(PUMP_METERS)):
                bits |= meters[1 + len(PUMP_METERS) * pump + number]["is_stuck"] << (1 + number)
            state["stuck"] |= bits


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
        DIFFERENCE_MEDIAN * float(median(np.abs(np.diff(values)[is_next]))) / max(abs(float(values.mean())), 1e-9)
        for values in (run.flow_m3h, run.head_m)
    ]
    return np.array(noise)


def healthy_noise(noises: Sequence[Floats]) -> Floats:
    """(2,) median of the noise of healthy runs, NaN where it was never known."""
    known = np.array([noise for noise in noises if np.isfinite(noise).all()])
    return median(known) if len(known) else np.full(2, math.nan)


def noisy_meters(run: Run, healthy: Floats) -> Mapping[str, float]:
    """Readings that are noisier than in health by more than `NOISY_FACTOR`, with that factor."""
    factors = reading_noise(run) / np.where(healthy > 0.0, healthy, math.nan)  # 0: the steps of the reading hide it
    return {
        name: round(float(factor), 1)
        for name, factor in zip(("flow_m3h", "head_m"), factors, strict=True)
        if factor > NOISY_FACTOR
    }
