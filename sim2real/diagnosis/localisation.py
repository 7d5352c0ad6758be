"""Which component a gap points to when no effect explains it: by its signals and how they move together."""

from collections.abc import Mapping

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.sim2real.diagnosis.lateness import (
    ALONE,
    DRIFT_BLOCKS,
    OF_CHANNEL,
    SWINGING,
    WHERE_IT_MOVES,
    are_ahead,
    block_means,
    is_late,
    mean_of,
)
from wetwell.sim2real.recording.regimes import IDLE, MULTI_PUMP, START_RAMP, STEADY, STOP_RAMP
from wetwell.sim2real.replay.observer import LEVEL_TIME_S
from wetwell.sim2real.residuals.asinh_loss import residuals_of
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
from wetwell.sim2real.residuals.groups import groups_of
from wetwell.sim2real.residuals.phases import since_begun_s
from wetwell.simulator.effects.effect import Component
from wetwell.simulator.parameters import PlantParameters

STRAIGHT = 0.8
"""Share of the scatter of blocks that a straight line explains; 0.6 for a sine of one period."""
OF_ZERO = 0.5
"""Change of an error of the power at less than half speed, over that at full speed, from which it is the zero of a
meter that moves: that is off by as much at any power, so 1. By the affinity laws a pump draws an eighth there, and
what a drive changes is a share of that. [1]"""
NEAR_S = 60
LASTING = 0.3
"""Share of the square of an imbalance that is still there a minute later; of a sensor that wanders, hardly any."""
ONE_SIDED = 5.0
"""Gap in starts over that in stops, or in stops over that in starts, from which it is in these alone. A check valve
that opens late shows in starts alone, and inertia in both; another area at the bottom in stops alone, and a level
sensor in both. [1]"""


def localise(
    excess: Floats,
    residuals: Floats,
    bins: Bins,
    plant: PlantParameters,
    patterns: Mapping[AnalogueQuantity, Component],
) -> Component:
    """Component that is held responsible.

    Flow and head that move along the pump curve say that the main has changed, along the system curve the pump (in
    ramps alone, the drive), flow alone its meter, head alone its sensor. Where most of the gap is of a channel whose
    values have a pattern, it is what makes that.

    Parameters
    ----------
    excess : (bins,) array
        What of the square of each residual is beyond noise, as of `excess_that_matters`.
    residuals : (bins,) array
    bins : Bins
    plant : PlantParameters
        Of the station as it is.
    patterns : mapping of quantity to Component
        Where patterns come from that the values of channels have, and that nothing known makes.
    """
    by_signal = np.maximum(np.bincount(bins.signal, excess, len(SIGNALS)), 0.0)
    total = max(by_signal.sum(), 1e-12)
    for quantity, component in patterns.items():
        if by_signal[[TELEMETRY, *OF_CHANNEL.get(quantity, ())]].sum() > 0.5 * total:
            return component
    if is_late(by_signal, excess, residuals, bins) or are_ahead(by_signal, residuals, bins):
        return "telemetry"
    hydraulic = by_signal[FLOW] + by_signal[HEAD]
    if hydraulic > (1.0 - ALONE) * total:
        return _hydraulic(excess, residuals, bins, plant)
    if by_signal[POWER] > 0.5 * total:
        is_read = _drifts(residuals, bins) or _is_of_zero(residuals, bins, plant.ramp_s)
        return "power_meter" if is_read else "drive"
    if by_signal[START_LEVEL] + by_signal[STOP_LEVEL] > by_signal[LEVEL]:
        return "controller"
    return _of_level(excess, residuals, bins)


def _of_level(excess: Floats, residuals: Floats, bins: Bins) -> Component:
    """Sump or level sensor: what is off in stops alone is another area at the bottom."""
    level = bins.signal == LEVEL
    calm = level & ((bins.regime == IDLE) | (bins.regime == STEADY) | (bins.regime == MULTI_PUMP))
    in_starts, in_stops = (mean_of(excess, level & (bins.regime == ramp)) for ramp in (START_RAMP, STOP_RAMP))
    in_calm = mean_of(excess, calm)
    if in_stops > max(ONE_SIDED * in_starts, in_calm):
        return "sump"
    is_sensor = min(in_starts, in_stops) > WHERE_IT_MOVES * in_calm or _wanders(residuals, bins, calm)
    return "level_sensor" if is_sensor else "sump"


def _drifts(residuals: Floats, bins: Bins) -> bool:
    """Whether the power runs away in a straight line: a meter does, a supply swings."""
    rows = (bins.signal == POWER) & ((bins.regime == STEADY) | (bins.regime == MULTI_PUMP))
    if rows.sum() < DRIFT_BLOCKS:
        return False
    order = np.argsort(bins.second[rows], kind="stable")
    means = block_means(residuals[rows][order])
    return bool(np.corrcoef(means, np.arange(DRIFT_BLOCKS))[0, 1] ** 2 > STRAIGHT)


def _is_of_zero(residuals: Floats, bins: Bins, ramp_s: float) -> bool:
    """Whether the power is off by as much, from run to run, before half speed as once the pump runs: a zero moves.

    A pump may have begun to turn up to a second before the first row that shows it.
    """
    power = bins.signal == POWER
    runs = power & ((bins.regime == STEADY) | (bins.regime == MULTI_PUMP))
    slow = power & (bins.regime == START_RAMP) & (since_begun_s(bins) + 2 <= ramp_s / 2.0)
    run = bins.cycle * 64 + bins.pump + 1
    size = int(run.max(initial=0)) + 1
    running, starting = groups_of(run, runs, size), groups_of(run, slow, size)
    both = (running.counts > 0) & (starting.counts > 0)
    if both.sum() < DRIFT_BLOCKS:
        return False
    error_kw = residuals_of(residuals) * bins.deviation
    at_speed, before = (of.means(error_kw)[both] for of in (running, starting))
    moved = at_speed - at_speed.mean()
    return bool(moved @ before > OF_ZERO * (moved @ moved))


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
