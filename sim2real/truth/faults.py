"""Faults of a true station: what they do, and the states by which a detector is judged."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.truth.case import TruthFault
from wetwell.sim2real.truth.spec import HOUR_S, Surroundings

PUMP_KINDS = {"blockage"}
SYSTEM_KINDS = {"clogging", "static_rise"}


def share(fault: TruthFault, seconds: int) -> Floats:
    """(seconds,) share of the full fault: 0 before, 1 from the end on, a half cosine between."""
    time_s = np.arange(seconds, dtype=np.float64)
    grown = np.clip((time_s - fault.start_s) / max(fault.end_s - fault.start_s, 1.0), 0.0, 1.0)
    return 0.5 * (1.0 - np.cos(np.pi * grown))


def force_faults(faults: Sequence[TruthFault], around: Surroundings) -> None:
    """Work faults of pumps, main and level sensor into the surroundings."""
    seconds = around.loss_factor.size
    time_s = np.arange(seconds, dtype=np.float64)
    for fault in faults:
        grown = share(fault, seconds)
        after_h = np.maximum(time_s - fault.start_s, 0.0) / HOUR_S
        match fault.kind:
            case "blockage":
                around.speed_factor[_rows(fault)] *= 1.0 - fault.size * grown
            case "clogging":
                around.loss_factor[:] *= 1.0 + fault.size * grown
            case "static_rise":
                around.extra_lift_m[:] += fault.size * grown
            case "sensor_bias" if fault.channel == "level_m":
                around.level_error_m[:] += fault.size * grown
            case "sensor_drift" if fault.channel == "level_m":
                around.level_error_m[:] += fault.size * after_h
            case "sensor_stuck" if fault.channel == "level_m":
                around.is_level_stuck[time_s >= fault.start_s] = 1.0
            case _:
                pass


def spoil(faults: Sequence[TruthFault], columns: dict[str, Floats]) -> None:
    """Work faults of the other sensors into the recorded columns, and gaps of all; zeros stay."""
    for fault in faults:
        for name in _columns_of(fault, columns):
            values = columns[name]
            time_s = np.arange(values.size, dtype=np.float64)
            acts = time_s >= fault.start_s
            is_alive = values != 0.0
            if fault.kind == "sensor_gap":
                columns[name] = np.where(acts, np.nan, values)
            elif fault.channel == "level_m":
                continue
            elif fault.kind == "sensor_bias":
                columns[name] = values + fault.size * share(fault, values.size) * is_alive
            elif fault.kind == "sensor_drift":
                after_h = np.maximum(time_s - fault.start_s, 0.0) / HOUR_S
                columns[name] = values + fault.size * after_h * is_alive
            elif fault.kind == "sensor_stuck":
                begin = int(np.ceil(fault.start_s))
                columns[name] = np.where(acts, values[min(begin, values.size - 1)], values)


def fault_states(faults: Sequence[TruthFault], pump: int | None, seconds: int) -> npt.NDArray[np.str_]:
    """(seconds,) states of a pump (from 1), or of the station, by the faults that act on it."""
    time_s = np.arange(seconds, dtype=np.float64)
    acts = np.zeros((3, seconds), dtype=np.bool_)
    for fault in faults:
        if pump is None or fault.pump in {0, pump}:
            row = 0 if fault.kind in PUMP_KINDS else 1 if fault.kind in SYSTEM_KINDS else 2
            acts[row] |= time_s > fault.start_s
    states = np.full(seconds, "normal", dtype="<U21")
    states[acts[2]] = "sensor_fault"
    states[acts[0]] = "pump_fault"
    states[acts[1]] = "system_fault"
    states[acts[0] & acts[1]] = "pump_and_system_fault"
    return states


def _rows(fault: TruthFault) -> slice:
    return slice(None) if fault.pump == 0 else slice(fault.pump - 1, fault.pump)


def _columns_of(fault: TruthFault, columns: dict[str, Floats]) -> list[str]:
    if fault.kind in PUMP_KINDS | SYSTEM_KINDS:
        return []
    if fault.channel in columns:
        return [fault.channel]
    prefix = "pump" if fault.pump == 0 else f"pump{fault.pump}_"
    return [name for name in columns if name.startswith(prefix) and name.endswith(f"_{fault.channel}")]
