r"""Drawdown: what a pump takes out of the wet well, against what its flow meter says.

The ratio of the metered flow to the drawdown flow, for runs of one pump alone after a time without any:

$$\rho = \ln \frac{Q}{A (\dot Y_{idle} - \dot Y_{run})}, \qquad Y = L - \frac{1}{A} \int Q_{in}\, dt$$

Where the inflow is not measured it is left out of Y: then it has to be the same before and during the run, and
the time without any pump must lie just before. Only changes of ρ count, so that A need not be right.
"""

import math
from typing import Any

import numpy as np

from wetwell.detector.stream.gate import MAX_GAP_S, seconds_between
from wetwell.detector.stream.run_state import is_break
from wetwell.protocols.arrays import Flags, Floats, Records
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, INFLOW, LEVEL, PUMP_VALUES
from wetwell.protocols.timestamps import NS_PER_S

SETTLED_S = 15.0
SETTLED_NS = int(SETTLED_S * NS_PER_S)
MIN_S = 60.0
MIN_NS = int(MIN_S * NS_PER_S)
MIN_READINGS = 4
MAX_S = 600.0
MAX_NS = int(MAX_S * NS_PER_S)
"""A longer phase begins anew, so that the inflow before a run is that just before it."""
MAX_AGE_S = 600.0
DEAD_RATIO = 0.01
"""Metered over drawdown flow of a meter that reads nothing."""

NOW, IDLE = 0, 1
PHASE = np.dtype(
    [(name, np.int64) for name in ("running", "begin_ns", "end_ns", "samples")]
    + [(name, np.float64) for name in ("time", "level", "time_time", "time_level", "came_m", "flow")]
)
"""Running sums while the same pumps run (one bit each); the slope of the level comes from them."""
NO_PHASE = -1


def new_phases() -> Records:
    """The phase that goes on, and the last one without any pump."""
    phases = np.zeros(2, dtype=PHASE)
    phases["running"] = NO_PHASE
    return phases


@compiled
def _slope_m_h(phase: Any) -> float:
    """Rise of the level, without what the inflow has brought, by least squares. [m/h]."""
    samples = phase["samples"]
    spread: float = phase["time_time"] - phase["time"] * phase["time"] / samples
    if spread <= 0.0:
        return math.nan
    product: float = phase["time_level"] - phase["time"] * phase["level"] / samples
    return 3600.0 * product / spread


@compiled
def _begin(phase: Any, running: int, begin_ns: int) -> None:
    phase["running"], phase["begin_ns"], phase["end_ns"], phase["samples"] = running, begin_ns, 0, 0
    phase["time"] = phase["level"] = phase["time_time"] = phase["time_level"] = 0.0
    phase["came_m"] = phase["flow"] = 0.0


@compiled
def _end(phases: Any, area_m2: float, pumps: Any) -> None:
    """Keep what the phase that ends has told."""
    phase, idle = phases[NOW], phases[IDLE]
    running = phase["running"]
    if running == NO_PHASE or phase["samples"] < MIN_READINGS or phase["end_ns"] - phase["begin_ns"] < MIN_NS:
        return
    if running == 0:
        phases[IDLE] = phases[NOW]
        return
    is_alone = running & (running - 1) == 0
    if not is_alone or idle["running"] == NO_PHASE or seconds_between(idle["end_ns"], phase["begin_ns"]) > MAX_AGE_S:
        return
    drawn_m3h = area_m2 * (_slope_m_h(idle) - _slope_m_h(phase))
    flow_m3h = phase["flow"] / phase["samples"]
    if drawn_m3h > 0.0:
        for pump in range(pumps.shape[0]):
            if running == 1 << pump:
                pumps[pump]["log_ratio"] = math.log(max(flow_m3h / drawn_m3h, DEAD_RATIO))


@compiled
def _add(phase: Any, time_ns: int, level_m: float, inflow_m_s: float, flow_m3h: float) -> None:
    """Take one reading into account."""
    time_s = (time_ns - phase["begin_ns"]) / NS_PER_S
    if phase["samples"]:
        phase["came_m"] += inflow_m_s * (time_ns - phase["end_ns"]) / NS_PER_S
    level_m -= phase["came_m"]
    phase["end_ns"] = time_ns
    phase["samples"] += 1
    phase["time"] += time_s
    phase["level"] += level_m
    phase["time_time"] += time_s * time_s
    phase["time_level"] += time_s * level_m
    phase["flow"] += flow_m3h


@compiled
def draw_down(
    phases: Any,
    area_m2: float,
    period: Any,
    time_ns: int,
    gap_s: float,
    frame: Floats,
    is_switched: Flags,
    pumps: Any,
) -> None:
    """Take a frame into account.

    Parameters
    ----------
    phases : new_phases()
    area_m2 : float
        A. [m²]
    period : new_sampling_period()[0]
        Before this frame.
    time_ns, gap_s, frame
        A sample that has passed the gate.
    is_switched : (pumps,) bool
        Whether each may have started or stopped within the interval that the sample stands for.
    pumps : (pumps,) records
        `is_running` is read; `log_ratio` becomes the ρ of a run that ends.
    """
    running = 0
    for pump in range(pumps.shape[0]):
        if pumps[pump]["is_running"]:
            running |= 1 << pump
    phase = phases[NOW]
    if phase["running"] != running or is_break(period, gap_s, MAX_GAP_S):
        _end(phases, area_m2, pumps)
        _begin(phase, running, time_ns)
    elif time_ns - phase["begin_ns"] >= MAX_NS and running == 0:
        _end(phases, area_m2, pumps)
        _begin(phase, running, time_ns - SETTLED_NS)
    if time_ns - phase["begin_ns"] < SETTLED_NS or is_switched.any() or math.isnan(frame[LEVEL]):
        return
    flow_m3h = 0.0
    for pump in range(pumps.shape[0]):
        if pumps[pump]["is_running"]:
            flow_m3h += frame[FIRST_PUMP + PUMP_VALUES * pump + FLOW]
    inflow_m_s = 0.0 if math.isnan(frame[INFLOW]) else frame[INFLOW] / 3600.0 / area_m2
    _add(phase, time_ns, frame[LEVEL], inflow_m_s, flow_m3h)
