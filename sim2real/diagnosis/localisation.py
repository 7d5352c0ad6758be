"""Which component a gap points to when no effect explains it: by its signals and how they move together."""

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.recording.regimes import IDLE, MULTI_PUMP, START_RAMP, STEADY, STOP_RAMP
from wetwell.sim2real.replay.observer import LEVEL_TIME_S
from wetwell.sim2real.residuals.bins import (
    FLOW,
    HEAD,
    LEVEL,
    POWER,
    SIGNALS,
    START_LEVEL,
    STOP_LEVEL,
    TELEMETRY,
    Bins,
)
from wetwell.simulator.effects.effect import Component
from wetwell.simulator.parameters import PlantParameters

DRIFT_BLOCKS = 12
STRAIGHT = 0.8
"""Share of the scatter of blocks that a straight line explains; 0.6 for a sine of one period."""
GROWN = 3.0
"""Gap in the last third of a recording over that in the first."""
NEAR_S = 60
LASTING = 0.3
"""Share of the square of an imbalance that is still there a minute later; of a sensor that wanders, hardly any."""
ONE_SIDED = 5.0
"""Gap in starts over that in stops from which the check valve opens late: inertia shows in both."""
SWINGING = 0.4
ALONE = 0.7
"""Share of the gap from which it is in one kind of signal alone."""


def localise(
    excess: Floats, residuals: Floats, bins: Bins, plant: PlantParameters, telemetry: Component
) -> Component:
    """Component that is held responsible.

    Flow and head that move along the pump curve say that the main has changed, along the system curve the pump (in
    ramps alone, the drive), flow alone its meter, head alone its sensor.

    Parameters
    ----------
    excess : (bins,) array
        What of the square of each residual is beyond noise.
    residuals : (bins,) array
    bins : Bins
    plant : PlantParameters
        Of the station as it is.
    telemetry : Component
        Where patterns of the values themselves come from.
    """
    by_signal = np.maximum(np.bincount(bins.signal, excess, len(SIGNALS)), 0.0)
    total = max(by_signal.sum(), 1e-12)
    hydraulic = by_signal[FLOW] + by_signal[HEAD]
    if _runs_late(excess, residuals, bins):
        return "telemetry"
    if hydraulic > (1.0 - ALONE) * total:
        return _hydraulic(excess, residuals, bins, plant)
    if by_signal[POWER] > 0.5 * total:
        return "power_meter" if _drifts(residuals, bins) else "drive"
    if by_signal[TELEMETRY] > 0.5 * total:
        return telemetry
    if by_signal[START_LEVEL] + by_signal[STOP_LEVEL] > by_signal[LEVEL]:
        return "controller"
    level = bins.signal == LEVEL
    ramp = level & ((bins.regime == START_RAMP) | (bins.regime == STOP_RAMP))
    calm = level & ((bins.regime == IDLE) | (bins.regime == STEADY) | (bins.regime == MULTI_PUMP))
    in_ramps, in_calm = (float(np.mean(excess[rows])) if rows.any() else 0.0 for rows in (ramp, calm))
    return "level_sensor" if in_ramps > 3.0 * in_calm or _wanders(residuals, bins, calm) else "sump"


def _drifts(residuals: Floats, bins: Bins) -> bool:
    """Whether the power runs away in a straight line: a meter does, a supply swings."""
    rows = (bins.signal == POWER) & ((bins.regime == STEADY) | (bins.regime == MULTI_PUMP))
    if rows.sum() < DRIFT_BLOCKS:
        return False
    order = np.argsort(bins.second[rows], kind="stable")
    means = np.array([part.mean() for part in np.array_split(residuals[rows][order], DRIFT_BLOCKS)])
    return bool(np.corrcoef(means, np.arange(DRIFT_BLOCKS))[0, 1] ** 2 > STRAIGHT)


def _wanders(residuals: Floats, bins: Bins, calm: Flags) -> bool:
    """Whether the level departs and comes back at random: a balance that does not close goes one way for minutes.

    What would have to flow in beside the balance, by the observer's equation, against itself a minute and more later.
    """
    rows = np.flatnonzero(calm)
    rows = rows[np.argsort(bins.second[rows], kind="stable")]
    error_m, second = residuals[rows] * bins.deviation[rows], bins.second[rows]
    slope = np.diff(error_m) / np.maximum(np.diff(second), 1) + (error_m[1:] + error_m[:-1]) / 2.0 / LEVEL_TIME_S
    is_next = (np.diff(second) <= NEAR_S) & (np.diff(bins.regime[rows]) == 0)
    together = is_next[:-2] & is_next[1:-1] & is_next[2:]
    if together.sum() < DRIFT_BLOCKS:
        return False
    noise_m2 = bins.floor[rows] * bins.deviation[rows] ** 2
    noise = (noise_m2[1:] + noise_m2[:-1]) / np.maximum(np.diff(second), 1) ** 2
    square = float(np.mean((slope**2 - noise)[:-2][together]))
    return float(np.mean((slope[:-2] * slope[2:])[together])) < LASTING * square


def _runs_late(excess: Floats, residuals: Floats, bins: Bins) -> bool:
    """Whether one channel departs where it moves, and ever more: its clock runs away.

    A level that is late is too low at starts and too high at stops.
    """
    by_signal = np.maximum(np.bincount(bins.signal, excess, len(SIGNALS)), 0.0)
    level = by_signal[LEVEL] + by_signal[START_LEVEL] + by_signal[STOP_LEVEL]
    third = bins.second * 3 // (int(bins.second.max(initial=0)) + 1)
    is_ramp = (bins.regime == START_RAMP) | (bins.regime == STOP_RAMP)
    for signal, own in ((FLOW, by_signal[FLOW]), (HEAD, by_signal[HEAD]), (LEVEL, level)):
        if own < ALONE * by_signal.sum():
            continue
        rows = bins.signal == signal
        if signal == LEVEL:
            late = [residuals[(bins.signal == one) & (third == 2)] for one in (START_LEVEL, STOP_LEVEL)]
            if min(part.size for part in late) == 0 or late[0].mean() > 0.0 or late[1].mean() < 0.0:
                return False
        elif _mean(excess, rows & is_ramp) < 3.0 * _mean(excess, rows & ~is_ramp):
            return False
        return _mean(excess, rows & (third == 2)) > GROWN * max(_mean(excess, rows & (third == 0)), 0.0)
    return False


def _mean(values: Floats, rows: Flags) -> float:
    return float(values[rows].mean()) if rows.any() else 0.0


def _hunts(residuals: Floats, bins: Bins, rows: Integers) -> bool:
    """Whether neighbouring bins of a run differ about as much as bins of that run that are far from one another."""
    order = rows[np.lexsort((bins.second[rows], bins.pump[rows]))]
    near = (np.diff(bins.pump[order]) == 0) & (np.diff(bins.second[order]) <= NEAR_S)
    noise = float(bins.floor[order].mean())
    steps = float(np.mean(np.diff(residuals[order])[near] ** 2)) / 2.0 - noise if near.any() else 0.0
    return steps > SWINGING * max(float(np.mean(residuals[order] ** 2)) - noise, 1e-12)


def _hydraulic(excess: Floats, residuals: Floats, bins: Bins, plant: PlantParameters) -> Component:
    stamp = (bins.second * 64 + bins.pump + 1) * 8 + bins.regime
    flow, head = np.flatnonzero(bins.signal == FLOW), np.flatnonzero(bins.signal == HEAD)
    if flow.size == 0 or head.size == 0:
        return "rising_main" if head.size == 0 else "head_sensor"
    _, of_flow, of_head = np.intersect1d(stamp[flow], stamp[head], return_indices=True)
    flow, head = flow[of_flow], head[of_head]
    calm = (bins.regime[flow] == STEADY) | (bins.regime[flow] == MULTI_PUMP)
    weight = np.maximum(excess[flow] + excess[head], 0.0)
    is_steady = (
        bool(weight[calm].mean() > 0.3 * weight[~calm].mean()) if calm.any() and not calm.all() else bool(calm.any())
    )
    if is_steady:
        flow, head = flow[calm], head[calm]
    pump = bins.pump[flow]
    _, c1, c2 = plant.curves[pump].T
    rated_m3h = plant.rated_flow_m3h[pump]
    friction_h2_m5 = np.array([plant.main_of(i).friction_h2_m5 for i in range(len(plant.pumps))])[pump]
    on_curve = c1 + 2.0 * c2 * rated_m3h
    on_system = 2.0 * friction_h2_m5 * rated_m3h
    scale = bins.deviation[flow] / bins.deviation[head]
    directions: dict[Component, tuple[Floats, Floats]] = {
        "rising_main": (np.ones(flow.size), on_curve * scale),
        "pump": (np.ones(flow.size), on_system * scale),
        "flow_meter": (np.ones(flow.size), np.zeros(flow.size)),
        "head_sensor": (np.zeros(flow.size), np.ones(flow.size)),
    }
    found: dict[Component, float] = {
        name: float(np.sum((residuals[flow] * x + residuals[head] * y) ** 2 / (x**2 + y**2)))
        for name, (x, y) in directions.items()
    }
    best = max(found, key=lambda name: found[name])
    if best == "rising_main" and not is_steady:
        starts, stops = (float(excess[bins.regime == ramp].sum()) for ramp in (START_RAMP, STOP_RAMP))
        return "pump" if starts > ONE_SIDED * max(stops, 0.0) else best
    is_drive = best == "pump" and (not is_steady or _hunts(residuals, bins, flow))
    return "drive" if is_drive else best
