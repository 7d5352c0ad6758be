"""The loop over samples: what each goes through before there is anything to judge. Live, a block has one sample.

The order within a sample: the gate, which pumps run, the drawdown; the runs that end are judged; the runs go on, and
one that has turned out blind is told; the watch over the sensors, and over pumps that lack what they are judged by;
the rolling F-test; a look at segments that are full. Where there is something to judge, the loop stops and says so,
and is called again to go on from there.
"""

from enum import IntEnum
from typing import Any

import numpy as np

from wetwell.detector.statistics.rolling_f_test import FIGURES, LEAST_SAMPLES, LOG_P, add_sample, solve
from wetwell.detector.stream.drawdown import draw_down
from wetwell.detector.stream.gate import let_through
from wetwell.detector.stream.missing_signals import gather_segments
from wetwell.detector.stream.run_state import collect, count_steady, note_gap, note_running
from wetwell.detector.stream.sampling_steps import USUAL
from wetwell.detector.stream.stuck_sensors import watch_sensors
from wetwell.protocols.arrays import Flags, Floats, Integers, Records
from wetwell.protocols.jit import compiled
from wetwell.protocols.timestamps import NS_PER_S


class Stop(IntEnum):
    """Why the loop stops, and so where it goes on: behind that, in the order of a sample.

    The first two lie between samples. `ROOM_FULL`: no steady sample more finds room.
    """

    SAMPLES_DONE = 0
    SEGMENT_FULL = 1
    RUNS_ENDED = 2
    ROOM_FULL = 3
    RUN_BLIND = 4
    SEGMENT_GATHERED = 5


@compiled
def process_samples(
    row: int,
    stop: int,
    time_ns: Integers,
    seq: Integers,
    values: Floats,
    is_switched: Flags,
    is_confirmed: Flags,
    sample_pumps: int,
    is_bad: bool,
    table: Records,
    ranges: Any,
    area_m2: float,
    frame: Floats,
    gate: Any,
    pumps: Any,
    sampling_period: Any,
    steady_samples: Any,
    phases: Any,
    stuck_sensors: Any,
    missing_signals: Any,
    windows: Floats,
    moments: Floats,
    counts: Integers,
    sampling_steps: Floats,
    lacks_head: Integers,
) -> tuple[int, int]:
    """Row of a block to go on at and why the loop stops, from a row and a stop on; changes the `StreamState`."""
    state, period = gate[0], sampling_period[0]
    while row < time_ns.shape[0]:
        now_ns = time_ns[row]
        if stop <= Stop.SEGMENT_FULL:
            told = now_ns, seq[row], values[row], sample_pumps, is_bad, is_confirmed[row]
            if not let_through(state, sampling_steps, ranges, *told, frame):
                row += 1
                continue
            is_ending = note_running(table, pumps, period, now_ns, state["gap_s"], sampling_steps[USUAL], frame)
            draw_down(phases, area_m2, period, now_ns, state["gap_s"], frame, is_switched[row], pumps)
            note_gap(period, state["gap_s"])
            stop = Stop.RUNS_ENDED.value
            if is_ending:
                return row, stop
        if stop <= Stop.ROOM_FULL:
            if count_steady(pumps) + pumps.shape[0] > steady_samples.shape[0]:
                return row, Stop.ROOM_FULL.value
            stop = Stop.RUN_BLIND.value
            if collect(table, pumps, now_ns, frame, is_switched[row], lacks_head, steady_samples):
                return row, stop
        watched = now_ns, state["gap_s"], sampling_steps[USUAL], frame, is_switched[row], lacks_head
        if stop <= Stop.RUN_BLIND and _watch(table, stuck_sensors, missing_signals, *watched, pumps):
            return row, Stop.SEGMENT_GATHERED.value
        segment_samples = period["segment_samples"]
        if _test_steady(pumps, segment_samples, now_ns, state["gap_s"], steady_samples, windows, moments, counts):
            return row + 1, Stop.SEGMENT_FULL.value
        row += 1
        stop = Stop.SAMPLES_DONE.value
    return row, Stop.SAMPLES_DONE.value


@compiled
def _watch(
    table: Records,
    stuck_sensors: Any,
    missing_signals: Any,
    now_ns: int,
    gap_s: float,
    usual_s: float,
    frame: Floats,
    is_switched: Flags,
    lacks_head: Integers,
    pumps: Any,
) -> bool:
    """Look at the readings by themselves; whether there is a full segment of a pump without head."""
    watch_sensors(stuck_sensors, now_ns, gap_s, usual_s, frame, pumps)
    is_full: bool = gather_segments(table, missing_signals, now_ns, gap_s, frame, is_switched, lacks_head, pumps)
    return is_full


@compiled
def _test_steady(
    pumps: Any,
    segment_samples: int,
    now_ns: int,
    gap_s: float,
    steady_samples: Any,
    windows: Floats,
    moments: Floats,
    counts: Integers,
) -> bool:
    """Count the time of the running pumps and add steady samples to the rolling test; whether to have a look."""
    is_full = False
    at = count_steady(pumps)
    for number in range(pumps.shape[0] - 1, -1, -1):
        pump = pumps[number]
        if pump["is_running"] and gap_s < np.inf:
            pump["run_s"] += gap_s
        if not pump["is_steady"]:
            continue
        at -= 1
        last = steady_samples[at]
        time_s = now_ns // NS_PER_S + now_ns % NS_PER_S / NS_PER_S
        add_sample(
            *(windows[number], moments[number], counts[number], time_s),
            *(last["flow_m3h"], last["head_m"], last["speed_ratio"], last["total_m3h"]),
        )
        figures = moments[number, FIGURES:]
        if counts[number, 0] >= LEAST_SAMPLES and solve(moments[number], figures):
            pump["pump_log_p"] = min(pump["pump_log_p"], figures[0, LOG_P])
            pump["system_log_p"] = min(pump["system_log_p"], figures[1, LOG_P])
        is_full = is_full or (not pump["is_learning"] and pump["samples"] % segment_samples == 0)
    return is_full
