"""Sensors that are stuck, told from the readings alone."""

from typing import Any

import numpy as np

from wetwell.detector.stream.run_state import USUAL_GAPS
from wetwell.protocols.arrays import Floats, Records
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, LEVEL, PUMP_METERS, PUMP_VALUES, pump_column
from wetwell.protocols.timestamps import NS_PER_S

STUCK_NS = 60 * NS_PER_S
STUCK_STEPS = 6.0
"""As often at least a reading has to repeat itself: in a slow feed that is longer than `STUCK_NS`."""
STUCK_FACTOR = 5.0
"""A reading may repeat this many times as long as it ever did in the learning phase."""
MAX_REPEAT_GAP_S = 120.0

STUCK_SENSOR = np.dtype(
    [(name, np.int64) for name in ("is_followed", "is_stuck", "since_ns", "longest_ns")] + [("last", np.float64)]
)
"""Whether the frame before had a reading too, whether that is stuck, since when it repeats itself, how long it ever
did while it was learnt."""


def new_stuck_sensors(pumps: int) -> Records:
    """State of the level and of three sensors a pump."""
    return np.zeros(1 + len(PUMP_METERS) * pumps, dtype=STUCK_SENSOR)


def stuck_names(pump: int, bits: int) -> list[str]:
    """Names of the readings that were stuck in a run of a pump (from 0)."""
    if not bits:
        return []
    names = ("level_m", *(pump_column(pump + 1, name) for name in PUMP_METERS))
    return sorted(name for bit, name in enumerate(names) if bits >> bit & 1)


@compiled
def _note(sensor: Any, value: float, time_ns: int, gap_s: float, usual_s: float, is_learning: bool) -> None:
    is_next = sensor["is_followed"] and gap_s <= max(MAX_REPEAT_GAP_S, USUAL_GAPS * usual_s)
    sensor["is_followed"] = 1
    if not is_next or value != sensor["last"]:
        sensor["last"] = value
        sensor["since_ns"] = time_ns
        sensor["is_stuck"] = 0
        return
    lasts_ns = time_ns - sensor["since_ns"]
    if sensor["is_stuck"]:
        return
    if is_learning:
        sensor["longest_ns"] = max(lasts_ns, sensor["longest_ns"])
    elif lasts_ns > max(STUCK_NS, STUCK_STEPS * usual_s * NS_PER_S, STUCK_FACTOR * sensor["longest_ns"]):
        sensor["is_stuck"] = 1


@compiled
def watch_sensors(stuck_sensors: Any, time_ns: int, gap_s: float, usual_s: float, frame: Floats, pumps: Any) -> None:
    """Note how long each reading other than 0 repeats itself exactly, in frames that follow one another.

    A feed that reports by exception, or in coarse steps, repeats itself in health: what the readings of a pump do
    while it is learnt is remembered, and what the level does while no pump is known.

    Parameters
    ----------
    stuck_sensors : new_stuck_sensors(pumps)
    time_ns, gap_s, frame
        A sample that has passed the gate.
    usual_s : float
        Usual step of the feed; 0 where it is not known. [s]
    pumps : (pumps,) records
        `is_running` and `is_learning` are read; `stuck` gathers, while a pump runs, a bit for each that is stuck.
    """
    is_learning = True
    for pump in range(pumps.shape[0]):
        is_learning = is_learning and pumps[pump]["is_learning"] != 0
    _note(stuck_sensors[0], frame[LEVEL], time_ns, gap_s, usual_s, is_learning)
    for pump in range(pumps.shape[0]):
        state, at = pumps[pump], FIRST_PUMP + PUMP_VALUES * pump + FLOW
        for number in range(len(PUMP_METERS)):
            sensor, value = stuck_sensors[1 + len(PUMP_METERS) * pump + number], frame[at + number]
            if value != 0.0 and (state["is_running"] or number == 0):
                _note(sensor, value, time_ns, gap_s, usual_s, state["is_learning"] != 0)
            else:
                sensor["is_followed"] = 0
        if state["is_running"]:
            bits = stuck_sensors[0]["is_stuck"]
            for number in range(len(PUMP_METERS)):
                bits |= stuck_sensors[1 + len(PUMP_METERS) * pump + number]["is_stuck"] << (1 + number)
            state["stuck"] |= bits
