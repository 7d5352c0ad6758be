"""The loop over samples: what each goes through before there is anything to judge. Live, a block has one sample.

The order within a sample: the gate, which pumps run, the drawdown; the runs that end are judged; the runs go on, and
one that has turned out blind is told; the watch over the meters, and over pumps without head; the rolling F-test; a
look at segments that are full. Where there is something to judge, the loop stops and says so, and is called again to
go on from there.
"""

from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import Table
from wetwell.detector.statistics.rolling_f_test import FIGURES, LEAST_SAMPLES, LOG_P, solve, take
from wetwell.detector.stream.drawdown import draw_down
from wetwell.detector.stream.gate import let_through
from wetwell.detector.stream.missing_signals import gather
from wetwell.detector.stream.run_state import collect, note_gap, note_running, steady_rows
from wetwell.detector.stream.stuck_sensors import watch_meters
from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled
from wetwell.protocols.timestamps import NS_PER_S

DONE, FULL, ENDED, BLIND, GATHERED, LOOK = range(6)
"""Why the loop stops: no sample is left, rows are full, runs have ended, one is blind, a segment is full: of a pump
without head, of one that can be judged."""
BEGIN, COLLECT, WATCH, TEST = range(4)
"""Where it begins within a sample."""
GOES_ON = {FULL: COLLECT, ENDED: COLLECT, BLIND: WATCH, GATHERED: TEST, LOOK: BEGIN}
"""Where it has to go on after a stop."""


@compiled
def advance(
    row: int,
    stage: int,
    time_ns: Integers,
    seq: Integers,
    values: Floats,
    sample_pumps: int,
    is_bad: bool,
    table: Table,
    gate: Any,
    ranges: Any,
    frame: Floats,
    pumps: Any,
    paces: Any,
    rows: Floats,
    phases: Any,
    area_m2: float,
    meters: Any,
    blinds: Any,
    windows: Floats,
    moments: Floats,
    counts: Integers,
) -> tuple[int, int]:
    """Row to go on at, and why the loop stops; from a stage of a row on. The state is changed in place."""
    state, pace = gate[0], paces[0]
    while row < time_ns.shape[0]:
        now_ns = time_ns[row]
        if stage == BEGIN:
            if not let_through(state, ranges, now_ns, seq[row], values[row], sample_pumps, is_bad, frame):
                row += 1
                continue
            is_ending = note_running(table, pumps, pace, now_ns, state["gap_s"], frame)
            draw_down(phases, area_m2, pace, now_ns, state["gap_s"], frame, pumps)
            note_gap(pace, state["gap_s"])
            stage = COLLECT
            if is_ending:
                return row, ENDED
        if stage == COLLECT:
            if steady_rows(pumps) + pumps.shape[0] > rows.shape[0]:
                return row, FULL
            stage = WATCH
            if collect(table, pumps, now_ns, frame, rows):
                return row, BLIND
        if stage == WATCH and _watch(meters, blinds, now_ns, state["gap_s"], frame, pumps):
            return row, GATHERED
        if _take_steady(pumps, pace["segment_samples"], now_ns, state["gap_s"], rows, windows, moments, counts):
            return row + 1, LOOK
        row += 1
        stage = BEGIN
    return row, DONE


@compiled
def _watch(meters: Any, blinds: Any, now_ns: int, gap_s: float, frame: Floats, pumps: Any) -> bool:
    """Look at the readings by themselves; whether there is a full segment of a pump without head."""
    watch_meters(meters, now_ns, gap_s, frame, pumps)
    is_full: bool = gather(blinds, now_ns, gap_s, frame, pumps)
    return is_full


@compiled
def _take_steady(
    pumps: Any,
    segment_samples: int,
    now_ns: int,
    gap_s: float,
    rows: Floats,
    windows: Floats,
    moments: Floats,
    counts: Integers,
) -> bool:
    """Count the time of the running pumps and take steady samples into the rolling test; whether to have a look."""
    is_full = False
    row = steady_rows(pumps)
    for number in range(pumps.shape[0] - 1, -1, -1):
        pump = pumps[number]
        if pump["is_running"] and gap_s < np.inf:
            pump["run_s"] += gap_s
        if not pump["is_steady"]:
            continue
        row -= 1
        last = rows[row]
        time_s = now_ns // NS_PER_S + now_ns % NS_PER_S / NS_PER_S
        take(windows[number], moments[number], counts[number], time_s, last[2], last[3], last[4], last[5])
        figures = moments[number, FIGURES:]
        if counts[number, 0] >= LEAST_SAMPLES and solve(moments[number], figures):
            pump["pump_log_p"] = min(pump["pump_log_p"], figures[0, LOG_P])
            pump["system_log_p"] = min(pump["system_log_p"], figures[1, LOG_P])
        is_full = is_full or (not pump["is_learning"] and pump["samples"] % segment_samples == 0)
    return is_full
