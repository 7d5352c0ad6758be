"""From probabilities to the state that is told."""

import numpy as np
from scipy.special import ndtr

from wetwell.detector.observation import PUMP, SYSTEM
from wetwell.detector.posterior import (
    BOTH,
    FLOW_METER,
    HEAD_SENSOR,
    NORMAL,
    PUMP_FAULT,
    STATES,
    SYSTEM_FAULT,
    Weighed,
)
from wetwell.protocols.messages import State

ALARM_PROBABILITY = 0.99
SEPARATED_SHARE = 0.7
"""Share of the faults' probability that the likeliest must have, or the crew cannot be chosen."""
METER_PROBABILITY = 0.9
METER_TOLERANCE = 0.03
"""Relative error of a meter that is told but not taken for a fault: in health it may wander by as much."""


def decide(weighed: Weighed, head_m: float) -> tuple[State, str | None]:
    """State to tell, and a remark.

    A fault above `ALARM_PROBABILITY`, if one of them stands out; a wrong meter if it reads wrong by more than
    `METER_TOLERANCE` with more than `METER_PROBABILITY`; normal, perhaps with a meter that is a little off, above one
    half; else unknown.

    Parameters
    ----------
    weighed : Weighed
    head_m : float
        Head of the run, to which the error of the head sensor is compared. [m]
    """
    p = weighed.probability
    fault = float(p[[PUMP_FAULT, SYSTEM_FAULT, BOTH]].sum())
    meter = float(p[[FLOW_METER, HEAD_SENSOR]].sum())
    is_flow = p[FLOW_METER] >= p[HEAD_SENSOR]
    scale = 1.0 if is_flow else max(abs(head_m), 1e-9)
    error = (weighed.flow_error if is_flow else weighed.head_error_m) / scale
    deviation = max((weighed.flow_deviation if is_flow else weighed.head_deviation_m) / scale, 1e-9)
    beyond = float(ndtr((-METER_TOLERANCE - error) / deviation) + ndtr((error - METER_TOLERANCE) / deviation))
    name = "flow meter" if is_flow else "head sensor"
    if fault > ALARM_PROBABILITY:
        best = PUMP_FAULT + int(np.argmax(p[[PUMP_FAULT, SYSTEM_FAULT, BOTH]]))
        if p[best] < SEPARATED_SHARE * fault:
            return "unknown", "something has moved, but pump and system cannot be told apart yet"
        if best in (PUMP_FAULT, BOTH) and weighed.shift_m[PUMP] > 0.0:
            return "unknown", "the pump gives more head than when it was learnt: re-baseline if it was repaired"
        is_burst = best == SYSTEM_FAULT and weighed.shift_m[SYSTEM] < 0.0
        return STATES[best], "the main takes less head: look for a burst or an open drain" if is_burst else None
    if meter * beyond > METER_PROBABILITY:
        return "sensor_fault", f"the {name} reads {error:+.1%}"
    remark = f"the {name} may read {error:+.1%}" if meter > 0.5 else None
    return ("normal", remark) if p[NORMAL] + meter * (1.0 - beyond) > 0.5 else ("unknown", remark)
