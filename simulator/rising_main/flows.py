"""Water of the mains: what flows in a second, by duty point, inertia or waves; air and leaks that go with it."""

import math

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import inlined
from wetwell.simulator.corrections.parts import BACK_FLOW, HEAD_LOSS, INERTIA, LEAST_LEFT, STATIC_HEAD
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.hydraulics import common_flows, header_back_flow_m3h, individual_flow_m3h
from wetwell.simulator.parameters import MainParameters, PlantRecords
from wetwell.simulator.rising_main.waves import STEPS, coming, let_back_m3h, pass_on, still_water
from wetwell.simulator.state import PlantState
from wetwell.simulator.wet_well import SECONDS_PER_HOUR

STAGE = 1.0 - math.sqrt(0.5)
"""γ of the two-stage implicit step of second order that damps every stiffness (R. Alexander 1977)."""


@inlined
def static_head_at_m(main: MainParameters, level_m: float, rise_m: float) -> float:
    """Static head of a main with the wet well at a level, and what a fault adds; may be negative. [m]."""
    static_head_m = main.static_head_m - main.level_slope * level_m
    return static_head_m - main.lift_slope * (level_m - main.lift_reference_m) + rise_m


@inlined
def move_water(plant: PlantRecords, state: PlantState, forcing: Forcing, second: int, m: int, level_m: float) -> None:
    """Set the flows of main m after the second and their means over it."""
    static_head_m = static_head_at_m(plant.mains[m], level_m, forcing.static_rise_m[m, second])
    friction_h2_m5 = plant.mains[m].friction_h2_m5 * forcing.friction_factor[m, second]
    pumps = plant.pumps_by_main[plant.pumps_until[m] : plant.pumps_until[m + 1]]
    leak_m3h = _standing_leak_m3h(plant, state, forcing, second, pumps) if plant.mains[m].is_common_header else 0.0
    flow_m3h, mean_m3h = state.flow_m3h, state.mean_flow_m3h
    for i in pumps:
        state.open_ratio[i] = _open_ratio(plant, state, m, i, static_head_m, friction_h2_m5)
    if not _has_inertia(plant, state, m, pumps):
        _solve_flows(plant, state, m, static_head_m, friction_h2_m5, 0.0, leak_m3h, 0.0)
        for i in pumps:
            mean_m3h[i] = flow_m3h[i]
        return
    is_moving = was_moving = False
    for i in pumps:
        was_moving = was_moving or mean_m3h[i] > 0.0 or flow_m3h[i] > 0.0
        is_moving = is_moving or state.open_ratio[i] > 0.0 or flow_m3h[i] > 0.0
        mean_m3h[i] = 0.0
    if not is_moving:
        return
    if plant.mains[m].wave_s * STEPS >= 2.0:
        _move_waves(plant, state, m, static_head_m, friction_h2_m5, was_moving, leak_m3h)
        return
    _move_column(plant, state, m, static_head_m, friction_h2_m5, leak_m3h)


@inlined
def _has_inertia(plant: PlantRecords, state: PlantState, m: int, pumps: Integers) -> bool:
    """Whether the water of main m has inertia at any of its pumps."""
    largest_s2_m2 = 0.0
    for i in pumps:
        largest_s2_m2 = max(largest_s2_m2, inertia_s2_m2(plant, state, m, i))
    return largest_s2_m2 > 0.0


@inlined
def inertia_s2_m2(plant: PlantRecords, state: PlantState, m: int, i: int) -> float:
    """Inertia of the water of main m at a pump, and what a correction adds. [s²/m²]."""
    of_main = plant.mains[m].inertia_s2_m2
    inertia: float = max(of_main + state.correction[INERTIA, i], LEAST_LEFT * of_main)
    return inertia


@inlined
def _open_ratio(
    plant: PlantRecords, state: PlantState, m: int, i: int, static_head_m: float, friction_h2_m5: float
) -> float:
    """Speed of a pump of main m, 0 behind a check valve that its head does not open. [1]."""
    ratio: float = state.speed_ratio[i]
    if plant.pumps[i].valve_opening_m <= 0.0 or state.flow_m3h[i] > 0.0:
        return ratio
    main = plant.mains[m]
    head_m = lift_at_m(state, i, static_head_m)
    if main.is_common_header:
        total_m3h = sum_of(state.flow_m3h, plant.pumps_by_main[plant.pumps_until[m] : plant.pumps_until[m + 1]])
        shared_h2_m5 = friction_h2_m5 * (1.0 + state.correction[HEAD_LOSS, i]) * main.shared_friction
        head_m += shared_h2_m5 * total_m3h * (total_m3h + main.linear_flow_m3h)
    return ratio if state.curves[i, 0] * ratio**2 > head_m + plant.pumps[i].valve_opening_m else 0.0


@inlined
def _move_column(
    plant: PlantRecords, state: PlantState, m: int, static_head_m: float, friction_h2_m5: float, leak_m3h: float
) -> None:
    """Set the flows of main m, whose water is accelerated as a whole, after the second, and their means over it."""
    flow_m3h, mean_m3h, before_m3h = state.flow_m3h, state.mean_flow_m3h, state.flow_before_m3h
    pumps = plant.pumps_by_main[plant.pumps_until[m] : plant.pumps_until[m + 1]]
    steps_per_s = STEPS / STAGE
    for _ in range(STEPS):
        for i in pumps:
            before_m3h[i] = flow_m3h[i]
        back_before_m3h = state.back_m3h[m]
        back_m3h = _solve_flows(
            plant, state, m, static_head_m, friction_h2_m5, steps_per_s, leak_m3h, back_before_m3h
        )
        back_m3h = back_before_m3h + (back_m3h - back_before_m3h) * (1.0 - STAGE) / STAGE
        for i in pumps:
            mean_m3h[i] += (1.0 - STAGE) * flow_m3h[i] / STEPS
            flow_m3h[i] = before_m3h[i] + (flow_m3h[i] - before_m3h[i]) * (1.0 - STAGE) / STAGE
        state.back_m3h[m] = _solve_flows(
            plant, state, m, static_head_m, friction_h2_m5, steps_per_s, leak_m3h, back_m3h
        )
        for i in pumps:
            mean_m3h[i] += STAGE * flow_m3h[i] / STEPS


@inlined
def _move_waves(
    plant: PlantRecords,
    state: PlantState,
    m: int,
    static_head_m: float,
    friction_h2_m5: float,
    was_moving: bool,
    leak_m3h: float,
) -> None:
    """Set the flows of main m, in which waves run, in the middles of steps; water at rest has forgotten its waves."""
    main, flow_m3h = plant.mains[m], state.flow_m3h
    pumps = plant.pumps_by_main[plant.pumps_until[m] : plant.pumps_until[m + 1]]
    way, s_m3h = 0.5 * main.wave_s * STEPS, main.linear_flow_m3h
    share = main.shared_friction if main.is_common_header else 1.0
    for step in range(STEPS):
        for at in pumps[:1] if main.is_common_header else pumps:
            water = state.water[at]
            b = 2.0 * inertia_s2_m2(plant, state, m, at) / (main.wave_s * SECONDS_PER_HOUR)
            lift_m = lift_at_m(state, at, static_head_m)
            loss_h2_m5 = friction_h2_m5 * (1.0 + state.correction[HEAD_LOSS, at])
            if step == 0 and not was_moving:
                still_water(water, lift_m)
            main_h2_m5 = loss_h2_m5 * share
            came_m, steepness = coming(water, way, b, main_h2_m5, s_m3h)
            if main.is_common_header:
                common_flows(
                    pumps,
                    state.curves,
                    state.open_ratio,
                    came_m + steepness * sum_of(flow_m3h, pumps),  # it takes off what flowed before
                    loss_h2_m5 * (1.0 - share),
                    0.0,
                    s_m3h,
                    steepness,
                    leak_m3h,
                    0.0,
                    flow_m3h,
                )
                total_m3h = sum_of(flow_m3h, pumps)
                if leak_m3h > 0.0:
                    total_m3h -= let_back_m3h(leak_m3h, came_m, steepness, total_m3h)
            else:
                total_m3h = flow_m3h[at] = individual_flow_m3h(
                    state.curves[at], state.open_ratio[at], came_m, 0.0, 0.0, steepness, 0.0
                )
            head_m = came_m + steepness * total_m3h
            pass_on(water, way, b, main_h2_m5, s_m3h, lift_m, head_m, total_m3h)
        for i in pumps:
            state.mean_flow_m3h[i] += flow_m3h[i] / STEPS


@inlined
def lift_at_m(state: PlantState, i: int, static_head_m: float) -> float:
    """Static head with the air at a pump, and what a correction adds; never negative. [m]."""
    lift_m: float = max(static_head_m + state.pumps[i].air_m + state.correction[STATIC_HEAD, i], 0.0)
    return lift_m


@inlined
def _solve_flows(
    plant: PlantRecords,
    state: PlantState,
    m: int,
    static_head_m: float,
    friction_h2_m5: float,
    steps_per_s: float,
    leak_m3h: float,
    back_before_m3h: float,
) -> float:
    """Set the flows of main m by its layout, and return what runs back; pipes of their own have air of their own.

    Without a step in time they are those of the duty points.
    """
    main, curves, flow_m3h = plant.mains[m], state.curves, state.flow_m3h
    pumps = plant.pumps_by_main[plant.pumps_until[m] : plant.pumps_until[m + 1]]
    if main.is_common_header:
        at = pumps[0]
        lift_m = lift_at_m(state, at, static_head_m)
        friction_h2_m5 *= 1.0 + state.correction[HEAD_LOSS, at]
        inertia_m_m3h = inertia_s2_m2(plant, state, m, at) / SECONDS_PER_HOUR * steps_per_s
        back_m3h: float = common_flows(
            pumps,
            curves,
            state.open_ratio,
            lift_m,
            friction_h2_m5 * (1.0 - main.shared_friction),
            friction_h2_m5 * main.shared_friction,
            main.linear_flow_m3h,
            inertia_m_m3h,
            leak_m3h,
            back_before_m3h,
            flow_m3h,
        )
        return back_m3h
    for i in pumps:
        lift_m = lift_at_m(state, i, static_head_m)
        own_h2_m5 = friction_h2_m5 * (1.0 + state.correction[HEAD_LOSS, i])
        inertia_m_m3h = inertia_s2_m2(plant, state, m, i) / SECONDS_PER_HOUR * steps_per_s
        flow_m3h[i] = individual_flow_m3h(
            curves[i], state.open_ratio[i], lift_m, own_h2_m5, main.linear_flow_m3h, inertia_m_m3h, flow_m3h[i]
        )
    return 0.0


@inlined
def gather_air(plant: PlantRecords, state: PlantState, m: int) -> None:
    """Let the air of main m grow while no water moves in it, and be purged while some does."""
    main = plant.mains[m]
    pumps = plant.pumps_by_main[plant.pumps_until[m] : plant.pumps_until[m + 1]]
    is_one = main.is_common_header or main.is_air_shared
    total_m3h = sum_of(state.mean_flow_m3h, pumps)
    for i in pumps:
        pump = state.pumps[i]
        flow_m3h = total_m3h if is_one else state.mean_flow_m3h[i]
        if flow_m3h > 0.0:
            pump.air_m -= pump.air_m / main.air_purge_s
        else:
            pump.air_m += (main.air_head_m - pump.air_m) / main.air_growth_s


@inlined
def back_flow_m3h(plant: PlantRecords, state: PlantState, forcing: Forcing, second: int, level_m: float) -> float:
    """Flow back into the wet well through the check valves of standing pumps: K sqrt(H), H the head behind.

    Where all pumps of a main stand, its water runs back as fast.
    """
    total_m3h = 0.0
    for m in range(plant.mains.size):
        pumps = plant.pumps_by_main[plant.pumps_until[m] : plant.pumps_until[m + 1]]
        leak_m3h, back_m3h = _standing_leak_m3h(plant, state, forcing, second, pumps), 0.0
        if leak_m3h <= 0.0 and state.back_m3h[m] == 0.0:
            continue
        if leak_m3h > 0.0:
            static_head_m = static_head_at_m(plant.mains[m], level_m, forcing.static_rise_m[m, second])
            if plant.mains[m].is_common_header:
                friction_h2_m5 = plant.mains[m].friction_h2_m5 * forcing.friction_factor[m, second]
                back_m3h = _header_back_m3h(plant, state, m, static_head_m, friction_h2_m5, leak_m3h)
            else:
                for i in pumps:
                    its_m3h = _valve_leak_m3h(plant, state, forcing, second, i)
                    back_m3h += its_m3h * math.sqrt(lift_at_m(state, i, static_head_m))
        if sum_of(state.speed_ratio, pumps) <= 0.0 and sum_of(state.mean_flow_m3h, pumps) <= 0.0:
            state.back_m3h[m] = back_m3h
        total_m3h += back_m3h
    return total_m3h


@inlined
def _header_back_m3h(
    plant: PlantRecords, state: PlantState, m: int, static_head_m: float, friction_h2_m5: float, leak_m3h: float
) -> float:
    """Flow back at the header of main m, beside the mean flows of the second. [m³/h]."""
    main = plant.mains[m]
    pumps = plant.pumps_by_main[plant.pumps_until[m] : plant.pumps_until[m + 1]]
    back_m3h: float = header_back_flow_m3h(
        leak_m3h,
        lift_at_m(state, pumps[0], static_head_m),
        friction_h2_m5 * main.shared_friction,
        main.linear_flow_m3h,
        sum_of(state.mean_flow_m3h, pumps),
    )
    return back_m3h


@inlined
def _valve_leak_m3h(plant: PlantRecords, state: PlantState, forcing: Forcing, second: int, i: int) -> float:
    """Flow back through the check valve of a pump at 1 m, if it stands. [m³/h]."""
    if state.speed_ratio[i] > 0.0 or state.flow_m3h[i] > 0.0:
        return 0.0
    told_m3h = plant.pumps[i].valve_leak_m3h + forcing.valve_leak_m3h[i, second]
    leak_m3h: float = max(told_m3h + state.correction[BACK_FLOW, i], 0.0)
    return leak_m3h


@inlined
def _standing_leak_m3h(
    plant: PlantRecords, state: PlantState, forcing: Forcing, second: int, pumps: Integers
) -> float:
    """Flow back through the check valves of those of some pumps that stand, at 1 m. [m³/h]."""
    leak_m3h = 0.0
    for i in pumps:
        leak_m3h += _valve_leak_m3h(plant, state, forcing, second, i)
    return leak_m3h


@inlined
def sum_of(values: Floats, pumps: Integers) -> float:
    """Sum of what some pumps have, in their order."""
    total = 0.0
    for i in pumps:
        total += values[i]
    return total
