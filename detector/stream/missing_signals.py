"""Segments of the readings that are left of a pump without flow, head or frequency."""

import math
from typing import Any

import numpy as np

from wetwell.detector.stream.gate import seconds_between
from wetwell.detector.stream.run_state import WARM_UP_NS
from wetwell.detector.stream.steady_samples import SEGMENT_S, SEGMENT_SAMPLES
from wetwell.protocols.arrays import Floats, Records
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, FREQUENCY, HEAD, POWER, PUMP_METERS, PUMP_VALUES

MISSING_SIGNALS = np.dtype(
    [(name, np.int64) for name in ("running", "settled_ns", "begin_ns", "last_ns", "samples", "is_full", "is_apart")]
    + [(name, np.float64) for name in PUMP_METERS]
)
"""Of one pump: how many pumps run on its main, sums over the segment that is being gathered, whether it is full, and
whether it is the first since the pump started, others did, or the stream broke."""


def new_missing_signals(pumps: int) -> Records:
    """State of the segments of so many pumps before the first sample."""
    return np.zeros(pumps, dtype=MISSING_SIGNALS)


@compiled
def gather_segments(
    table: Records, missing_signals: Any, time_ns: int, gap_s: float, frame: Floats, pumps: Any
) -> bool:
    """Gather the readings of pumps that run, are being learnt, and lack flow, head or frequency.

    Parameters
    ----------
    table : Datasheet.table()
    missing_signals : new_missing_signals(pumps)
    time_ns, gap_s, frame
        A sample that has passed the gate.
    pumps : (pumps,) records
        `is_running` and `is_learning` are read.

    Returns
    -------
    bool
        Whether there is a pump of which a segment is full.
    """
    any_full = False
    for number in range(pumps.shape[0]):
        segment, at = missing_signals[number], FIRST_PUMP + PUMP_VALUES * number
        segment["is_full"] = 0
        is_seen = not math.isnan(frame[at + FREQUENCY] + frame[at + FLOW] + frame[at + HEAD])
        if is_seen or not pumps[number]["is_running"] or not pumps[number]["is_learning"]:
            continue
        running = 0
        for other in range(pumps.shape[0]):
            running += pumps[other]["is_running"] != 0 and table[other]["main"] == table[number]["main"]
        is_apart = gap_s == math.inf or seconds_between(segment["last_ns"], time_ns) > 1.5 * gap_s
        segment["last_ns"] = time_ns
        if is_apart or running != segment["running"]:
            segment["running"] = running
            segment["settled_ns"] = time_ns + WARM_UP_NS
            segment["samples"] = 0
            segment["is_apart"] = 1
        if time_ns < segment["settled_ns"]:
            continue
        if segment["samples"] == 0:
            segment["begin_ns"] = time_ns
            segment["flow_m3h"] = segment["head_m"] = segment["power_kw"] = 0.0
        segment["samples"] += 1
        segment["flow_m3h"] += frame[at + FLOW]
        segment["head_m"] += frame[at + HEAD]
        segment["power_kw"] += frame[at + POWER]
        lasts_s = seconds_between(segment["begin_ns"], time_ns) + gap_s
        segment["is_full"] = segment["samples"] >= SEGMENT_SAMPLES or lasts_s >= SEGMENT_S
        any_full = any_full or segment["is_full"] != 0
    return any_full
