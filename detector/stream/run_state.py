"""The open runs of a station from sample to sample: which pumps run, and which samples are steady; compiled."""

import math
from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet, duty_flows, static_head_at_m
from wetwell.detector.stream.steady_samples import SEGMENT_SAMPLES
from wetwell.protocols.arrays import Flags, Floats, Integers, Records
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, FREQUENCY, HEAD, LEVEL, POWER, PUMP_VALUES, RUNNING
from wetwell.protocols.timestamps import NS_PER_S

WARM_UP_S = 30.0
SETTLING_S = 10.0
SPEED_STEP = 0.02
"""A change of the speed by more than this share of nominal has to settle."""
MIN_SPEED_RATIO = 0.4
MAX_SPEED_RATIO = 1.25
MAX_RUN_S = 1800.0
MAX_RUN_STEPS = 4.0
"""Of a slow feed a part of a run lasts so many steps at least."""
BREAK_S = 60.0
USUAL_GAPS = 2.5
"""A feed that is slow by itself breaks only where it lacks more than so many of its usual steps."""
RUNNING_SHARE = 0.05
"""Share of the run-out flow, or of the nominal frequency, above which a pump that does not say so is running."""
SIGNALS = ("frequency_hz", "flow_m3h", "head_m", "level_m", "power_kw")
NEEDED = frozenset({"frequency_hz", "flow_m3h", "head_m"})
"""What a pump is judged by; without a head in all of its runs, by the other two."""
HEAD_BIT = 1 << SIGNALS.index("head_m")
NEEDED_BITS = sum(1 << bit for bit, name in enumerate(SIGNALS) if name in NEEDED)
"""Places of the head, and of all that is needed, in the bits of the signals that a run has had."""
LEVEL_BIT = 1 << SIGNALS.index("level_m")
"""Needed too where the main lifts to a delivery level."""
LACKED_FLOW_ALONE = len(SIGNALS)
"""Place behind them: the flow was missing while no other pump of the main ran."""
BLIND_S = 60.0
"""A run that has lacked one of them for so long is reported at once."""
WARM_UP_NS, SETTLING_NS, PART_NS, BLIND_NS = (int(s * NS_PER_S) for s in (WARM_UP_S, SETTLING_S, MAX_RUN_S, BLIND_S))

PUMP_STATE = np.dtype(
    [
        (name, np.int64)
        for name in (
            "is_running",
            "is_open",
            "is_ending",
            "is_steady",
            "is_reported_blind",
            "is_blind",
            "is_learning",
            "start_ns",
            "part_ns",
            "last_ns",
            "steady_from_ns",
            "samples",
            "seen",
            "stuck",
        )
    ]
    + [
        (name, np.float64)
        for name in ("speed_ratio", "duty_speed", "duty_m3h", "run_s", "log_ratio", "pump_log_p", "system_log_p")
    ]
)
"""What is known of a pump from sample to sample.

The open run: its start, that of the part being collected, its last sample, when it will be steady, how many steady
samples it has, a bit for each signal that it has had, and whether one that is needed has never come. Speed and flow
by the datasheet. For others: whether the pump is being learnt, a bit for each meter that was stuck in the run, time
that it ran, the drawdown figure of its last run, and the smallest log p of the rolling tests since they were told.
"""
SAMPLING_PERIOD = np.dtype([("segment_samples", np.int64), ("gap_s", np.float64), ("gap_before_s", np.float64)])
"""How fast a feed comes: samples in a segment, as the last run had them, and the last two gaps that are known."""


def new_pumps(datasheet: Datasheet) -> Records:
    """State of the pumps of a station before the first sample."""
    pumps = np.zeros(datasheet.pumps, dtype=PUMP_STATE)
    pumps["speed_ratio"] = pumps["log_ratio"] = math.nan
    pumps["is_learning"] = 1
    return pumps


def new_sampling_period() -> Records:
    """Sampling period of a feed before its first sample."""
    period = np.zeros(1, dtype=SAMPLING_PERIOD)
    period["segment_samples"] = SEGMENT_SAMPLES
    return period


@compiled
def is_break(period: Any, gap_s: float, limit_s: float) -> bool:
    """Whether a gap is longer than the limit, and than the feed's own period explains."""
    return bool(gap_s > limit_s and gap_s > USUAL_GAPS * min(period["gap_s"], period["gap_before_s"]))


@compiled
def note_gap(period: Any, gap_s: float) -> None:
    """Remember a gap, after it has been judged."""
    if gap_s < math.inf:
        period["gap_before_s"] = period["gap_s"]
        period["gap_s"] = gap_s


@compiled
def _says_running(own: Any, frame: Floats, at: int, is_open: bool) -> bool:
    """Whether a pump runs: by its flag, else by frequency or flow, else as it did."""
    if not math.isnan(frame[at + RUNNING]):
        return bool(frame[at + RUNNING] > 0.0)
    if not math.isnan(frame[at + FREQUENCY]):
        return bool(frame[at + FREQUENCY] > RUNNING_SHARE * own["frequency_hz"])
    if not math.isnan(frame[at + FLOW]):
        return bool(frame[at + FLOW] > RUNNING_SHARE * own["runout_m3h"])
    return is_open


@compiled
def _settle(pump: Any, now_ns: int, wait_ns: int) -> None:
    pump["steady_from_ns"] = max(pump["steady_from_ns"], now_ns + wait_ns)


@compiled
def note_running(
    table: Records, pumps: Any, period: Any, time_ns: int, gap_s: float, usual_s: float, frame: Floats
) -> bool:
    """Note which pumps run; whether a run ends with this frame, or a part of one (`is_ending`)."""
    part_ns = max(PART_NS, MAX_RUN_STEPS * usual_s * NS_PER_S)
    is_broken = is_break(period, gap_s, BREAK_S)
    changed_mains, any_ending = 0, False
    for number in range(pumps.shape[0]):
        pump = pumps[number]
        is_open = pump["is_open"] != 0
        at = FIRST_PUMP + PUMP_VALUES * number
        is_running = _says_running(table[number], frame, at, is_open and not is_broken)
        if is_running != (pump["is_running"] != 0):
            changed_mains |= 1 << table[number]["main"]
        pump["is_running"] = is_running
        is_over = is_broken or not is_running or time_ns - pump["part_ns"] >= part_ns
        pump["is_ending"] = is_open and is_over
        any_ending = any_ending or (is_open and is_over)
        if is_open and is_broken:
            pump["is_open"] = 0
    if changed_mains:
        for number in range(pumps.shape[0]):
            if pumps[number]["is_open"] and changed_mains >> table[number]["main"] & 1:
                _settle(pumps[number], time_ns, WARM_UP_NS)
    return any_ending


@compiled
def count_steady(pumps: Any) -> int:
    """Number of steady samples in all open runs."""
    count = 0
    for number in range(pumps.shape[0]):
        count += pumps[number]["samples"]
    return count


@compiled
def drop_ended(pumps: Any, steady_samples: Any, time_ns: int) -> None:
    """Close the runs that end, and begin the next part of those that go on."""
    kept = 0
    for at in range(count_steady(pumps)):
        if not pumps[int(steady_samples[at]["pump"])]["is_ending"]:
            steady_samples[kept] = steady_samples[at]
            kept += 1
    for number in range(pumps.shape[0]):
        pump = pumps[number]
        if pump["is_ending"]:
            pump["is_ending"] = pump["samples"] = pump["seen"] = 0
            pump["is_open"] = pump["is_open"] and pump["is_running"]
            pump["part_ns"] = time_ns


@compiled
def _note_duty(table: Records, pumps: Any, frame: Floats) -> None:
    """Flows by the datasheet; worked out anew only when a speed has changed, or the level may move a lift."""
    is_new = False
    for number in range(pumps.shape[0]):
        is_new = is_new or table[number]["level_slope"] > 0.0
        pump, frequency_hz = pumps[number], frame[FIRST_PUMP + PUMP_VALUES * number + FREQUENCY]
        speed = frequency_hz / table[number]["frequency_hz"] if pump["is_running"] and frequency_hz > 0.0 else 0.0
        is_new = is_new or speed != pump["duty_speed"]
        pump["duty_speed"] = speed
    if is_new:
        duty_flows(table, pumps, frame[LEVEL])


@compiled
def _totals(table: Records, pumps: Any, main: int, frame: Floats) -> tuple[float, float]:
    """Total flow of a main, as measured and by the datasheet. [m³/h]."""
    total_m3h = duty_total_m3h = 0.0
    for number in range(pumps.shape[0]):
        if table[number]["main"] != main:
            continue
        duty_total_m3h += pumps[number]["duty_m3h"]
        if pumps[number]["is_running"]:
            total_m3h += frame[FIRST_PUMP + PUMP_VALUES * number + FLOW]
    return total_m3h, duty_total_m3h


@compiled
def _is_alone(table: Records, pumps: Any, number: int) -> bool:
    """Whether no other pump of the same main runs."""
    for other in range(pumps.shape[0]):
        if other != number and pumps[other]["is_running"] and table[other]["main"] == table[number]["main"]:
            return False
    return True


@compiled
def is_disturbed(table: Records, number: int, is_switched: Flags) -> bool:
    """Whether a pump of the same main may have started or stopped within the interval that a sample stands for."""
    for other in range(table.shape[0]):
        if is_switched[other] and table[other]["main"] == table[number]["main"]:
            return True
    return False


@compiled
def _collect(
    table: Records,
    pumps: Any,
    number: int,
    time_ns: int,
    frame: Floats,
    is_switched: Flags,
    lacks_head: bool,
    steady: Any,
) -> bool:
    """Take the frame into the open run of a pump; whether it is steady, and so has become this record.

    A pump that lacks a head sensor has the head that its main takes, by the datasheet, at the flow that is measured.
    """
    pump, own, at = pumps[number], table[number], FIRST_PUMP + PUMP_VALUES * number
    flow_m3h, head_m = frame[at + FLOW], frame[at + HEAD]
    for bit, value in enumerate((frame[at + FREQUENCY], flow_m3h, head_m, frame[LEVEL], frame[at + POWER])):
        if not math.isnan(value):
            pump["seen"] |= 1 << bit
    if math.isnan(flow_m3h) and _is_alone(table, pumps, number):
        pump["seen"] |= 1 << LACKED_FLOW_ALONE
    speed_ratio = frame[at + FREQUENCY] / own["frequency_hz"]
    if not abs(speed_ratio - pump["speed_ratio"]) <= SPEED_STEP:
        pump["speed_ratio"] = speed_ratio
        _settle(pump, time_ns, SETTLING_NS)
    is_usable = MIN_SPEED_RATIO <= speed_ratio <= MAX_SPEED_RATIO
    if time_ns < pump["steady_from_ns"] or not is_usable or is_disturbed(table, number, is_switched):
        return False
    static_head_m = static_head_at_m(own, frame[LEVEL])
    if math.isnan(flow_m3h + static_head_m) or (math.isnan(head_m) and not lacks_head):
        return False
    _note_duty(table, pumps, frame)
    total_m3h, duty_total_m3h = flow_m3h, pump["duty_m3h"]
    if own["is_common_header"]:
        total_m3h, duty_total_m3h = _totals(table, pumps, own["main"], frame)
        if math.isnan(total_m3h):
            return False
    if lacks_head:
        head_m = static_head_m + own["friction_h2_m5"] * total_m3h * total_m3h
    steady["pump"] = number
    steady["time_s"] = (time_ns - pump["part_ns"]) / NS_PER_S
    steady["flow_m3h"] = flow_m3h
    steady["head_m"] = head_m
    steady["speed_ratio"] = speed_ratio
    steady["total_m3h"] = total_m3h
    steady["level_m"] = frame[LEVEL]
    steady["power_kw"] = frame[at + POWER]
    steady["duty_m3h"] = pump["duty_m3h"] / speed_ratio
    steady["duty_total_m3h"] = duty_total_m3h
    return True


@compiled
def collect(
    table: Records,
    pumps: Any,
    time_ns: int,
    frame: Floats,
    is_switched: Flags,
    lacks_head: Integers,
    steady_samples: Any,
) -> bool:
    """Take a frame into the runs, after those that it ends are dropped; whether one has turned out blind.

    A frame in whose interval a pump may have been switched (`is_switched`) is steady for none of its main.
    """
    at = count_steady(pumps)
    any_blind = False
    for number in range(pumps.shape[0]):
        pump = pumps[number]
        pump["is_steady"] = pump["is_blind"] = 0
        if not pump["is_running"]:
            continue
        if not pump["is_open"]:
            pump["is_open"] = 1
            pump["is_reported_blind"] = pump["samples"] = pump["seen"] = 0
            pump["start_ns"] = pump["part_ns"] = time_ns
            pump["steady_from_ns"] = time_ns + WARM_UP_NS
            pump["speed_ratio"] = math.nan
        pump["last_ns"] = time_ns
        is_without = lacks_head[number] != 0
        if _collect(table, pumps, number, time_ns, frame, is_switched, is_without, steady_samples[at]):
            pump["is_steady"] = 1
            pump["samples"] += 1
            at += 1
        if not pump["is_reported_blind"] and time_ns - pump["start_ns"] >= BLIND_NS:
            pump["is_reported_blind"] = 1
            needed = NEEDED_BITS | LEVEL_BIT if table[number]["level_slope"] > 0.0 else NEEDED_BITS
            if is_without:
                needed &= ~HEAD_BIT
            pump["is_blind"] = pump["seen"] & needed != needed
            any_blind = any_blind or pump["is_blind"] != 0
    return any_blind
