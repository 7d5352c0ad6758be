"""From probabilities to the state that is told."""

import numpy as np
from scipy.special import ndtr

from wetwell.detector.inference.observation import PUMP, SYSTEM
from wetwell.detector.inference.posterior import (
    BOTH,
    FLOW_METER,
    HEAD_SENSOR,
    NORMAL,
    PUMP_FAULT,
    STATES,
    SYSTEM_FAULT,
    Posterior,
)
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import State

ALARM_PROBABILITY = 0.99
SEPARATED_SHARE = 0.7
"""Share of the faults' probability that the likeliest must have, or the crew cannot be chosen."""
BEYOND_PROBABILITY = 0.9
"""That a fault must have of being larger than what a meter may be wrong by."""
METER_PROBABILITY = 0.9
METER_TOLERANCE = 0.03
"""Relative error of a meter that is told but not taken for a fault: in health it may wander by as much."""


def decide(posterior: Posterior, head_m: float) -> tuple[State, str | None]:
    """State to tell, and a remark.

    A fault above `ALARM_PROBABILITY`, if one of them stands out and its shift is larger than `tolerance_m`; a wrong
    meter if it reads wrong by more than `METER_TOLERANCE` with more than `METER_PROBABILITY`; normal, perhaps with a
    meter that is a little off, above one half; else unknown.

    Parameters
    ----------
    posterior : Posterior
    head_m : float
        Head of the run, to which the error of the head sensor is compared. [m]
    """
    p = posterior.probability
    fault = float(p[[PUMP_FAULT, SYSTEM_FAULT, BOTH]].sum())
    meter = float(p[FLOW_METER] + p[HEAD_SENSOR])
    is_flow = p[FLOW_METER] >= p[HEAD_SENSOR]
    scale = 1.0 if is_flow else max(abs(head_m), 1e-9)
    error = (posterior.flow_error if is_flow else posterior.head_error_m) / scale
    deviation = max((posterior.flow_deviation if is_flow else posterior.head_deviation_m) / scale, 1e-9)
    beyond = float(_beyond(error, deviation, METER_TOLERANCE))
    name = "flow meter" if is_flow else "head sensor"
    if fault > ALARM_PROBABILITY:
        best = PUMP_FAULT + int(np.argmax(p[[PUMP_FAULT, SYSTEM_FAULT, BOTH]]))
        if p[best] < SEPARATED_SHARE * fault:
            return "unknown", "something has moved, but pump and system cannot be told apart yet"
        return _sized(best, posterior)
    if meter * beyond > METER_PROBABILITY:
        return "sensor_fault", f"the {name} reads {error:+.1%}"
    remark = f"the {name} may read {error:+.1%}" if meter > 0.5 else None
    return ("normal", remark) if p[NORMAL] + meter * (1.0 - beyond) > 0.5 else ("unknown", remark)


def onset_component(state: State) -> int | None:
    """Component of the shift in which the onset of a fault shows; None without a fault."""
    return {"pump_fault": PUMP, "system_fault": SYSTEM, "pump_and_system_fault": PUMP}.get(state)


def _sized(best: int, posterior: Posterior) -> tuple[State, str | None]:
    """State and remark of a fault that is certain, by how large it is."""
    moved = np.array([best in (PUMP_FAULT, BOTH), best in (SYSTEM_FAULT, BOTH)])
    beyond = np.where(moved, _beyond(posterior.shift_m, posterior.deviation_m, posterior.tolerance_m), 0.0)
    has_pump, has_system = beyond > BEYOND_PROBABILITY
    if has_pump and posterior.shift_m[PUMP] > 0.0:
        return "unknown", "the pump gives more head than when it was learnt: re-baseline if it was repaired"
    if has_pump:
        return STATES[BOTH if has_system else PUMP_FAULT], None
    if has_system:
        is_burst = posterior.shift_m[SYSTEM] < 0.0
        return STATES[
            SYSTEM_FAULT
        ], "the main takes less head: look for a burst or an open drain" if is_burst else None
    where = "the pump" if best == PUMP_FAULT else "the main"
    return "unknown" if beyond.max() > 0.5 else "normal", f"{where} or the flow meter has moved a little"


def _beyond(value: Floats | float, deviation: Floats | float, limit: Floats | float) -> Floats:
    """Probability that what is estimated with this standard deviation lies beyond a limit, on either side."""
    return np.asarray(ndtr((-limit - value) / deviation) + ndtr((value - limit) / deviation))
