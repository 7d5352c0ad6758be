"""The plant, second by second: one compiled loop, the same for a live second and for a batch of days.

The arrays and their rows are those of `layout` (here `at`); `plant` makes them.
"""

import math

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, INFLOW, LEVEL
from wetwell.simulator import layout as at
from wetwell.simulator.drive import turned_ratio
from wetwell.simulator.hydraulics import common_flows, individual_flows, pump_head_m
from wetwell.simulator.power import electrical_power_kw, loaded_power_kw, shaft_power_kw
from wetwell.simulator.supervision import drive, supervise
from wetwell.simulator.telemetry.sending import is_plain_telemetry, read_pumps, send, silence
from wetwell.simulator.telemetry.sensors import delayed, sense
from wetwell.simulator.wet_well import level_at_volume_m, next_volume_m3, overflow_m3h

INERTIA_STEPS = 3
"""Steps within a second in which the column of water is accelerated."""
STAGE = 1.0 - math.sqrt(0.5)
"""γ of the two-stage implicit step of second order that damps every stiffness (R. Alexander 1977)."""


@compiled
def advance(
    station: Floats,
    pump: Floats,
    profile: Floats,
    levels: Floats,
    sensor: Floats,
    station_state: Floats,
    pump_state: Floats,
    channel_state: Floats,
    past: Floats,
    level_history: Floats,
    started: Integers,
    recent_starts: Integers,
    counters: Integers,
    curves: Floats,
    station_force: Floats,
    pump_force: Floats,
    sensor_force: Floats,
    rng: np.random.Generator,
    measured: Floats,
    station_truth: Floats,
    pump_truth: Floats,
) -> None:
    """Advance a plant by as many seconds as the forcing has, one PLC scan a second.

    In each second: flows and heads follow from the frequencies that the drives have; the volume integrates the
    balance; the sensors are read; the controller acts on the level that it sees; the drives move on. So that a start
    command at second t shows as a frequency from second t + 1 on. Flows and heads are means over the second, which
    is the same as their value at its beginning where the water has no inertia.

    `measured` and `pump_truth` are to come as zeros: a pump that stands leaves them so, and while all pumps stand and
    no water moves nothing is computed for them. Most seconds of most stations are of this kind.

    The noise is drawn in a fixed order (level, inflow, then flow, head and power of each active pump), so that
    blocks of any length give the same numbers.
    """
    is_sensor_forced = sensor_force.shape[2] > 1
    is_plain = not is_sensor_forced and is_plain_telemetry(sensor)
    is_silent = False
    for second in range(station_force.shape[1]):
        level_m = level_at_volume_m(station_state[at.VOLUME], profile)
        static_head_m = station[at.STATIC_HEAD] - station[at.LIFT_SLOPE] * (level_m - station[at.LIFT_REFERENCE])
        static_head_m += station_force[at.STATIC_RISE, second]
        friction_h2_m5 = station[at.FRICTION] * station_force[at.FRICTION_FACTOR, second]
        is_moving = is_moving_now(pump_state)
        if is_moving:
            turn_pumps(station, pump, pump_state, pump_force, second, curves)
            move_water(station, pump_state, curves, static_head_m, friction_h2_m5)
        if station[at.AIR_HEAD] > 0.0:
            gather_air(station, pump_state)
        over_m3h = overflow_m3h(level_m, station[at.OVERFLOW_LEVEL], station[at.WEIR_WIDTH], profile)
        inflow_m3h = station_force[at.INFLOW_FORCE, second]
        back_m3h = back_flow_m3h(station, pump, pump_state, pump_force, second, static_head_m, friction_h2_m5)
        station_state[at.VOLUME] = next_volume_m3(
            station_state[at.VOLUME],
            inflow_m3h + station[at.UNMETERED_INFLOW] + back_m3h,
            over_m3h,
            pump_state[at.MEAN_FLOW],
        )
        if is_moving:
            voltage_factor = station_force[at.VOLTAGE_FACTOR, second]
            load_pumps(station, pump, pump_state, voltage_factor, curves, second, pump_truth)
        station_truth[at.TRUE_LEVEL, second] = level_m
        station_truth[at.TRUE_OVERFLOW, second] = over_m3h

        is_frozen = station_force[at.IS_PLC_FROZEN, second] > 0.0
        at_force = second if is_sensor_forced else 0
        now_s = counters[at.SECOND]
        seen_level_m = sense(LEVEL, level_m, True, sensor, channel_state, sensor_force, at_force, rng)
        send(LEVEL, seen_level_m, is_frozen, now_s, sensor, channel_state, past, measured, second)
        reading = sense(INFLOW, inflow_m3h, True, sensor, channel_state, sensor_force, at_force, rng)
        send(INFLOW, reading, is_frozen, now_s, sensor, channel_state, past, measured, second)
        may_rest = is_plain and not is_frozen
        if is_moving or not may_rest:
            read_pumps(
                pump_state,
                pump_truth,
                is_frozen,
                may_rest,
                now_s,
                sensor,
                channel_state,
                past,
                sensor_force,
                at_force,
                rng,
                measured,
                second,
            )
            is_silent = False
        elif not is_silent:
            silence(channel_state, FIRST_PUMP, channel_state.shape[1])
            is_silent = True

        if not is_frozen:
            if station[at.CONTROL_DELAY] > 0.0:
                seen_level_m = delayed(level_history, seen_level_m, now_s, station[at.CONTROL_DELAY])
            supervise(
                station,
                pump,
                levels,
                station_state,
                pump_state,
                pump_force,
                second,
                started,
                recent_starts,
                counters,
                seen_level_m,
            )
        drive(station, pump, pump_state, pump_force, second, station_state[at.WANTED_FREQUENCY])
        counters[at.SECOND] += 1


@compiled
def is_moving_now(pump_state: Floats) -> bool:
    """Whether any pump is driven, turns, or has water moving in it, now or in the second before."""
    for i in range(pump_state.shape[1]):
        if (
            pump_state[at.FREQUENCY_NOW, i] > 0.0
            or pump_state[at.SHAFT_RATIO, i] > 0.0
            or pump_state[at.FLOW_NOW, i] > 0.0
            or pump_state[at.MEAN_FLOW, i] > 0.0
        ):
            return True
    return False


@compiled
def turn_pumps(
    station: Floats, pump: Floats, pump_state: Floats, pump_force: Floats, second: int, curves: Floats
) -> None:
    """Set the curve of each pump, and the speed that the water sees: command, ramp, slip, ragging, blockage."""
    for i in range(pump.shape[1]):
        commanded = pump_state[at.FREQUENCY_NOW, i] / pump[at.NOMINAL_FREQUENCY, i]
        turned = turned_ratio(
            commanded,
            pump_state[at.SHAFT_RATIO, i],
            station[at.RAMP_POWER],
            station[at.SPEED_LAG],
            station[at.RAMP_BOW],
        )
        pump_state[at.SHAFT_RATIO, i] = turned
        if turned <= 0.0:
            pump_state[at.SPEED_RATIO, i] = 0.0
            pump_state[at.LOAD, i] = 0.0
            pump_state[at.RAGGING, i] = 0.0
            if pump_state[at.FLOW_NOW, i] <= 0.0:
                continue
        ragging = pump_state[at.RAGGING, i]
        left = (1.0 - pump[at.SLIP, i] * pump_state[at.LOAD, i]) * (1.0 - ragging)
        pump_state[at.SPEED_RATIO, i] = turned * left * pump_force[at.SPEED_FACTOR, i, second]
        pump_state[at.RAGGING, i] += (pump[at.RAGGING_LIMIT, i] - ragging) / pump[at.RAGGING_TIME, i]
        factor = pump_force[at.HEAD_FACTOR, i, second]
        leak_m3h = pump_force[at.INTERNAL_LEAK, i, second]
        curves[i, 0] = factor * (pump[at.C0, i] + (pump[at.C1, i] + pump[at.C2, i] * leak_m3h) * leak_m3h)
        curves[i, 1] = factor * (pump[at.C1, i] + 2.0 * pump[at.C2, i] * leak_m3h)
        curves[i, 2] = factor * pump[at.C2, i]


@compiled
def move_water(
    station: Floats, pump_state: Floats, curves: Floats, static_head_m: float, friction_h2_m5: float
) -> None:
    """Set the flows after the second and their means over it."""
    flow_m3h = pump_state[at.FLOW_NOW]
    mean_m3h = pump_state[at.MEAN_FLOW]
    if station[at.INERTIA] <= 0.0:
        _solve_flows(station, pump_state, curves, static_head_m, friction_h2_m5, 0.0)
        for i in range(mean_m3h.size):
            mean_m3h[i] = flow_m3h[i]
        return
    inertia_m_m3h = station[at.INERTIA] / 3600.0 * INERTIA_STEPS / STAGE
    before_m3h = pump_state[at.FLOW_BEFORE]
    for i in range(mean_m3h.size):
        mean_m3h[i] = 0.0
    for _ in range(INERTIA_STEPS):
        for i in range(mean_m3h.size):
            before_m3h[i] = flow_m3h[i]
        _solve_flows(station, pump_state, curves, static_head_m, friction_h2_m5, inertia_m_m3h)
        for i in range(mean_m3h.size):
            mean_m3h[i] += (1.0 - STAGE) * flow_m3h[i] / INERTIA_STEPS
            flow_m3h[i] = before_m3h[i] + (flow_m3h[i] - before_m3h[i]) * (1.0 - STAGE) / STAGE
        _solve_flows(station, pump_state, curves, static_head_m, friction_h2_m5, inertia_m_m3h)
        for i in range(mean_m3h.size):
            mean_m3h[i] += STAGE * flow_m3h[i] / INERTIA_STEPS


@compiled
def _solve_flows(
    station: Floats,
    pump_state: Floats,
    curves: Floats,
    static_head_m: float,
    friction_h2_m5: float,
    inertia_m_m3h: float,
) -> None:
    """Set the flows by the layout of the mains, each with its own air."""
    speed_ratio = pump_state[at.SPEED_RATIO]
    flow_m3h = pump_state[at.FLOW_NOW]
    lift_m = max(static_head_m + pump_state[at.AIR, 0], 0.0)
    if station[at.IS_COMMON_HEADER] > 0.0:
        own_h2_m5 = friction_h2_m5 * (1.0 - station[at.SHARED_FRICTION])
        for i in range(flow_m3h.size):
            curves[i, 2] -= own_h2_m5
        common_flows(
            curves, speed_ratio, lift_m, friction_h2_m5 * station[at.SHARED_FRICTION], inertia_m_m3h, flow_m3h
        )
        for i in range(flow_m3h.size):
            curves[i, 2] += own_h2_m5
    elif station[at.AIR_HEAD] > 0.0:
        for i in range(flow_m3h.size):
            one = slice(i, i + 1)
            lift_m = max(static_head_m + pump_state[at.AIR, i], 0.0)
            individual_flows(curves[one], speed_ratio[one], lift_m, friction_h2_m5, inertia_m_m3h, flow_m3h[one])
    else:
        individual_flows(curves, speed_ratio, lift_m, friction_h2_m5, inertia_m_m3h, flow_m3h)


@compiled
def gather_air(station: Floats, pump_state: Floats) -> None:
    """Let the air of each main grow while no water moves in it, and be purged while some does."""
    is_one = station[at.IS_COMMON_HEADER] > 0.0 or station[at.IS_AIR_SHARED] > 0.0
    total_m3h = 0.0
    for i in range(pump_state.shape[1]):
        total_m3h += pump_state[at.MEAN_FLOW, i]
    for i in range(pump_state.shape[1]):
        air_m = pump_state[at.AIR, i]
        flow_m3h = total_m3h if is_one else pump_state[at.MEAN_FLOW, i]
        if flow_m3h > 0.0:
            pump_state[at.AIR, i] -= air_m / station[at.AIR_PURGE]
        else:
            pump_state[at.AIR, i] += (station[at.AIR_HEAD] - air_m) / station[at.AIR_GROWTH]


@compiled
def back_flow_m3h(
    station: Floats,
    pump: Floats,
    pump_state: Floats,
    pump_force: Floats,
    second: int,
    static_head_m: float,
    friction_h2_m5: float,
) -> float:
    """Flow back into the wet well through the check valves of standing pumps: K sqrt(H), H the head behind."""
    back_m3h = 0.0
    for i in range(pump.shape[1]):
        leak_m3h = pump[at.VALVE_LEAK, i] + pump_force[at.VALVE_LEAK_FORCE, i, second]
        if leak_m3h > 0.0 and pump_state[at.SPEED_RATIO, i] <= 0.0 and pump_state[at.FLOW_NOW, i] <= 0.0:
            head_m = max(static_head_m + pump_state[at.AIR, i], 0.0)
            if station[at.IS_COMMON_HEADER] > 0.0:
                total_m3h = 0.0
                for k in range(pump.shape[1]):
                    total_m3h += pump_state[at.MEAN_FLOW, k]
                head_m += friction_h2_m5 * total_m3h**2
            back_m3h += leak_m3h * math.sqrt(head_m)
    return back_m3h


@compiled
def load_pumps(
    station: Floats,
    pump: Floats,
    pump_state: Floats,
    voltage_factor: float,
    curves: Floats,
    second: int,
    pump_truth: Floats,
) -> None:
    """Note flow, head and power of each pump, and the torque of its motor as a share of the rated one."""
    for i in range(pump.shape[1]):
        flow_m3h = pump_state[at.MEAN_FLOW, i]
        shaft_ratio = pump_state[at.SHAFT_RATIO, i]
        if shaft_ratio <= 0.0 and flow_m3h <= 0.0:
            continue
        head_m = 0.0
        power_kw = 0.0
        if shaft_ratio > 0.0:  # a standing pump reads 0, also while the water still moves through it
            head_m = pump_head_m(curves[i, 0], curves[i, 1], curves[i, 2], pump_state[at.SPEED_RATIO, i], flow_m3h)
            rated_shaft_kw = pump[at.RATED_HYDRAULIC, i] / station[at.PUMP_EFFICIENCY]
            shaft_kw = shaft_power_kw(
                shaft_ratio, flow_m3h, pump[at.RATED_FLOW, i], rated_shaft_kw, station[at.SHUTOFF_POWER_SHARE]
            )
            pump_state[at.LOAD, i] = shaft_kw / (rated_shaft_kw * shaft_ratio)
            if pump_state[at.FREQUENCY_NOW, i] > 0.0:
                by_load = station[at.LOAD_SHARE]
                power_kw = (1.0 - by_load) * electrical_power_kw(
                    station[at.VOLTAGE],
                    station[at.RATED_CURRENT],
                    station[at.POWER_FACTOR],
                    pump_state[at.FREQUENCY_NOW, i] / pump[at.NOMINAL_FREQUENCY, i],
                )
                if by_load > 0.0:
                    power_kw += by_load * loaded_power_kw(
                        shaft_kw, rated_shaft_kw, station[at.MOTOR_EFFICIENCY], station[at.DRIVE_EFFICIENCY]
                    )
                power_kw *= voltage_factor
        pump_truth[at.TRUE_FLOW, i, second] = flow_m3h
        pump_truth[at.TRUE_HEAD, i, second] = head_m
        pump_truth[at.TRUE_POWER, i, second] = power_kw
