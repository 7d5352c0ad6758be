"""The gate: order, range and presence of values, before any statistic sees them.

It lets samples through in the order of their time, with values that can be. A value that is absent, NaN or outside
its range becomes NaN and is counted. A sample that is doubled or late is dropped and counted. A sample that jumps
more than `MAX_JUMP_S` and `MAX_JUMP_STEPS` usual steps ahead ("future"), and samples that are behind, may come from
a source whose clock was set: after `CONFIRMATIONS` such samples in a row that agree with one another, the gate
follows them and counts a clock step. The usual step is learnt from the stream; before the second sample it may be
any up to `SLOWEST_STEP_S`. Those that are behind with old numbers are most likely sent again after a lost link, and
it takes more than `RESENT_SAMPLES` of them: then the source has begun anew. In a recording the rows that come next
are known: where they confirm a sample that jumps ahead, it comes after a gap and passes.

`samples` = frames + `doubled` + `late` + `future` - `clock_steps`. `lost` counts the numbers that `seq` has passed
over; a sample that comes late after all is counted there too.
"""

import math
from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.stream.run_state import USUAL_GAPS
from wetwell.detector.stream.sampling_steps import SLOWEST_STEP_S, USUAL, note_step
from wetwell.protocols.arrays import Floats, Records
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, FREQUENCY, HEAD, INFLOW, LEVEL, POWER, PUMP_VALUES, RUNNING
from wetwell.protocols.timestamps import NS_PER_S

MAX_GAP_S = 10.0
MAX_JUMP_S = 600.0
MAX_JUMP_STEPS = 10.0
"""Seconds and usual steps by which a sample may lie ahead of the last one: beyond both its stamp is doubted."""
MIN_GAP_S = 0.05
"""Samples nearer to each other are taken for one that is doubled."""
MAX_LOST = 1_000_000
CONFIRMATIONS = 10
RESENT_SAMPLES = 1000
"""More samples than a bus sends again after a lost link; they come with numbers that were there before."""
LEVEL_RANGE_M = (-1.0, 100.0)
"""Of the level over the floor of the wet well."""
POWER_RANGE_KW = (-1.0, 1.0e6)
CENTURY_S = 3.2e9

COUNTS = (
    "samples",
    "doubled",
    "late",
    "future",
    "clock_steps",
    "gaps",
    "lost",
    "bad_quality",
    "wrong_pump_count",
    "missing_values",
    "out_of_range_values",
)
GATE = np.dtype(
    [(name, np.int64) for name in ("is_begun", "time_ns", "seq", "other_ns", "other_count", *COUNTS)]
    + [(name, np.float64) for name in ("gap_s", "seen_s")]
)
"""Stamp and number of the last sample let through, of the last one that disagreed, counts, time since the sample
before, and the time in all that the station has been seen."""
RANGES = np.dtype(
    [
        (f"{end}_{name}", np.float64)
        for name in ("level_m", "frequency_hz", "flow_m3h", "head_m")
        for end in ("low", "high")
    ]
)


def new_gate() -> Records:
    """State of the gate before the first sample."""
    return np.zeros(1, dtype=GATE)


def gate_counts(gate: Any) -> dict[str, int]:
    """How many samples and values were let through, marked or dropped; those that are not 0."""
    return {name: int(gate[name][0]) for name in COUNTS if gate[name][0]}


def gate_ranges(datasheet: Datasheet) -> Records:
    """Lowest and highest readings that each pump can show; the level is the same for all."""
    return np.array([_ranges(datasheet, pump) for pump in range(datasheet.pumps)], dtype=RANGES)


def _ranges(datasheet: Datasheet, pump: int) -> tuple[float, ...]:
    """Lowest and highest level, frequency, flow and head that a pump can show."""
    runout_m3h = datasheet.runout_flow_m3h(pump)
    return (
        datasheet.floor_level_m + LEVEL_RANGE_M[0],
        datasheet.floor_level_m + LEVEL_RANGE_M[1],
        -0.5,
        2.0 * datasheet.frequencies_hz[pump],
        -0.1 * runout_m3h,
        2.0 * runout_m3h,
        -10.0,
        3.0 * datasheet.curves[pump][0],
    )


@compiled
def seconds_between(earlier_ns: int, later_ns: int) -> float:
    """Time between stamps, to the nanosecond but for those that lie so far apart that their difference overflows."""
    about_s = later_ns / NS_PER_S - earlier_ns / NS_PER_S
    if abs(about_s) > CENTURY_S:
        return about_s
    return (later_ns - earlier_ns) / NS_PER_S


@compiled
def _is_in_order(state: Any, steps: Floats, time_ns: int, seq: int, is_confirmed: bool) -> bool:
    """Whether a sample is let through; its gap is noted."""
    if not state["is_begun"]:
        state["gap_s"] = 0.0
        return True
    gap_s = seconds_between(state["time_ns"], time_ns)
    since_other_s = seconds_between(state["other_ns"], time_ns)
    may_be_resent = gap_s < 0.0 and seq <= state["seq"]
    is_other_ahead = seconds_between(state["time_ns"], state["other_ns"]) > 0.0
    is_step = is_other_ahead or (gap_s < 0.0 and not may_be_resent)  # of what is sent again nothing is learnt
    if state["other_count"] > 0 and since_other_s >= MIN_GAP_S and is_step:
        note_step(steps, since_other_s)
    max_jump_s = max(MAX_JUMP_S, MAX_JUMP_STEPS * steps[USUAL]) if steps[USUAL] > 0.0 else SLOWEST_STEP_S
    if MIN_GAP_S <= gap_s <= max_jump_s:
        state["gap_s"] = gap_s
        return True
    if 0.0 <= gap_s < MIN_GAP_S or (state["other_count"] > 0 and 0.0 <= since_other_s < MIN_GAP_S):
        state["doubled"] += 1
        return False
    if is_confirmed and gap_s > max_jump_s:
        state["gap_s"] = math.inf
        return True
    if gap_s < 0.0:
        state["late"] += 1
    else:
        state["future"] += 1
    follows = state["other_count"] > 0 and 0.0 < since_other_s <= max_jump_s
    state["other_count"] = state["other_count"] + 1 if follows else 1
    state["other_ns"] = time_ns
    if state["other_count"] < (RESENT_SAMPLES if may_be_resent else CONFIRMATIONS):
        return False
    state["clock_steps"] += 1
    state["gap_s"] = math.inf
    return True


@compiled
def _count_lost(state: Any, seq: int, is_let_through: bool) -> None:
    last = state["seq"]
    if state["is_begun"] and 1 < seq - last <= MAX_LOST:  # beyond, the source counts from elsewhere
        state["lost"] += seq - last - 1
    if seq > last or is_let_through:
        state["seq"] = seq


@compiled
def _checked(state: Any, value: float, low: float, high: float) -> float:
    """The value, or NaN, and counted, where it is absent or cannot be."""
    if low <= value <= high:
        return value
    if math.isfinite(value):
        state["out_of_range_values"] += 1
    else:
        state["missing_values"] += 1
    return math.nan


@compiled
def let_through(
    state: Any,
    steps: Floats,
    ranges: Any,
    time_ns: int,
    seq: int,
    values: Floats,
    pumps: int,
    is_bad: bool,
    is_confirmed: bool,
    frame: Floats,
) -> bool:
    """Whether a sample passes; then `frame` holds its values."""
    state["samples"] += 1
    is_let_through = _is_in_order(state, steps, time_ns, seq, is_confirmed)
    _count_lost(state, seq, is_let_through)
    if not is_let_through:
        return False
    state["is_begun"] = 1
    state["time_ns"] = time_ns
    state["other_count"] = 0
    if state["gap_s"] > MAX_GAP_S and steps[USUAL] > 0.0 and state["gap_s"] > USUAL_GAPS * steps[USUAL]:
        state["gaps"] += 1
    note_step(steps, state["gap_s"])
    if math.isfinite(state["gap_s"]):
        state["seen_s"] += state["gap_s"]
    frame[:] = math.nan
    if is_bad:
        state["bad_quality"] += 1
        return True
    if pumps != ranges.shape[0]:
        state["wrong_pump_count"] += 1
    frame[LEVEL] = _checked(state, values[LEVEL], ranges[0]["low_level_m"], ranges[0]["high_level_m"])
    if math.isfinite(values[INFLOW]):
        frame[INFLOW] = values[INFLOW]
    for pump in range(min(pumps, ranges.shape[0])):
        limits, at = ranges[pump], FIRST_PUMP + PUMP_VALUES * pump
        frame[at + FREQUENCY] = _checked(
            state, values[at + FREQUENCY], limits["low_frequency_hz"], limits["high_frequency_hz"]
        )
        frame[at + FLOW] = _checked(state, values[at + FLOW], limits["low_flow_m3h"], limits["high_flow_m3h"])
        frame[at + HEAD] = _checked(state, values[at + HEAD], limits["low_head_m"], limits["high_head_m"])
        frame[at + POWER] = _checked(state, values[at + POWER], POWER_RANGE_KW[0], POWER_RANGE_KW[1])
        frame[at + RUNNING] = values[at + RUNNING]
    return True
