"""The plant, second by second: one compiled loop, the same for a live second and for a batch of days.

The arrays and their rows are those of `layout` (here `at`); `plant` makes them.
"""

import math

import numpy as np
import numpy.typing as npt

from wetwell.simulator import layout as at
from wetwell.simulator.channels import FLOW, FREQUENCY, HEAD, INFLOW, LEVEL, POWER, pump_channel
from wetwell.simulator.control import (
    NOTHING,
    SECONDS_PER_HOUR,
    controlled_frequency_hz,
    next_in_rotation,
    wanted_change,
)
from wetwell.simulator.drive import next_frequency_hz, turned_ratio
from wetwell.simulator.hydraulics import common_flows, individual_flows, pump_head_m
from wetwell.simulator.jit import compiled
from wetwell.simulator.power import electrical_power_kw, loaded_power_kw, shaft_power_kw
from wetwell.simulator.sensors import delayed, sense, transmit
from wetwell.simulator.wet_well import level_at_volume_m, next_volume_m3, overflow_m3h

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

INERTIA_STEPS = 5
"""Steps within a second in which the column of water is accelerated."""


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

    The noise is drawn in a fixed order (level, inflow, then flow, head and power of each active pump), so that
    blocks of any length give the same numbers.
    """
    is_sensor_forced = sensor_force.shape[2] > 1
    is_idle_quiet = not is_sensor_forced and _is_plain(sensor)
    for second in range(station_force.shape[1]):
        level_m = level_at_volume_m(station_state[at.VOLUME], profile)
        _turn_pumps(pump, pump_state, pump_force, second, station[at.RAMP_POWER], station[at.SPEED_LAG], curves)
        static_head_m = station[at.STATIC_HEAD] - station[at.LIFT_SLOPE] * (level_m - station[at.LIFT_REFERENCE])
        static_head_m += station_state[at.AIR] + station_force[at.STATIC_RISE, second]
        static_head_m = max(static_head_m, 0.0)
        friction_h2_m5 = station[at.FRICTION] * station_force[at.FRICTION_FACTOR, second]
        _move_water(station, station_state, pump_state, curves, static_head_m, friction_h2_m5)
        over_m3h = overflow_m3h(level_m, station[at.OVERFLOW_LEVEL], station[at.WEIR_WIDTH], profile)
        inflow_m3h = station_force[at.INFLOW_FORCE, second]
        back_m3h = _back_flow_m3h(station, pump, pump_state, pump_force, second, static_head_m, friction_h2_m5)
        station_state[at.VOLUME] = next_volume_m3(
            station_state[at.VOLUME],
            inflow_m3h + station[at.UNMETERED_INFLOW] + back_m3h,
            over_m3h,
            pump_state[at.MEAN_FLOW],
        )
        _load_pumps(station, pump, pump_state, station_force[at.VOLTAGE_FACTOR, second], curves, second, pump_truth)
        station_truth[at.TRUE_LEVEL, second] = level_m
        station_truth[at.TRUE_OVERFLOW, second] = over_m3h

        is_frozen = station_force[at.IS_PLC_FROZEN, second] > 0.0
        at_force = second if is_sensor_forced else 0
        seen_level_m = sense(LEVEL, level_m, True, sensor, channel_state, sensor_force, at_force, rng)
        _send(LEVEL, seen_level_m, is_frozen, counters[at.SECOND], sensor, channel_state, past, measured, second)
        reading = sense(INFLOW, inflow_m3h, True, sensor, channel_state, sensor_force, at_force, rng)
        _send(INFLOW, reading, is_frozen, counters[at.SECOND], sensor, channel_state, past, measured, second)
        for i in range(pump.shape[1]):
            frequency_hz = pump_state[at.FREQUENCY_NOW, i]
            is_active = frequency_hz > 0.0 or pump_state[at.MEAN_FLOW, i] > 0.0
            channel = pump_channel(FREQUENCY, i)
            if is_idle_quiet and not is_active and not is_frozen:
                for k in range(channel, channel + 4):
                    measured[k, second] = 0.0
                    channel_state[at.LAST_READING, k] = 0.0
                    channel_state[at.LAST_SENT, k] = 0.0
                continue
            _send(
                channel, frequency_hz, is_frozen, counters[at.SECOND], sensor, channel_state, past, measured, second
            )
            for quantity, row in ((FLOW, at.TRUE_FLOW), (HEAD, at.TRUE_HEAD), (POWER, at.TRUE_POWER)):
                channel = pump_channel(quantity, i)
                value = pump_truth[row, i, second]
                reading = sense(channel, value, is_active, sensor, channel_state, sensor_force, at_force, rng)
                _send(channel, reading, is_frozen, counters[at.SECOND], sensor, channel_state, past, measured, second)

        if not is_frozen:
            if station[at.CONTROL_DELAY] > 0.0:
                seen_level_m = delayed(level_history, seen_level_m, counters[at.SECOND], station[at.CONTROL_DELAY])
            _supervise(
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
        _drive(station, pump, pump_state, pump_force, second, station_state[at.WANTED_FREQUENCY])
        counters[at.SECOND] += 1


@compiled
def _is_plain(sensor: Floats) -> bool:
    """Whether an idle pump's channels just read 0: nothing damped, delayed or held."""
    for k in range(sensor.shape[1]):
        if sensor[at.LAG, k] > 0.0 or sensor[at.DELAY, k] > 0.0 or sensor[at.DEADBAND, k] > 0.0:
            return False
    return True


@compiled
def _turn_pumps(
    pump: Floats,
    pump_state: Floats,
    pump_force: Floats,
    second: int,
    ramp_power: float,
    speed_lag_s: float,
    curves: Floats,
) -> None:
    """Set the curve of each pump, and the speed that the water sees: command, ramp, slip, ragging, blockage."""
    for i in range(pump.shape[1]):
        commanded = pump_state[at.FREQUENCY_NOW, i] / pump[at.NOMINAL_FREQUENCY, i]
        turned = turned_ratio(commanded, pump_state[at.SHAFT_RATIO, i], ramp_power, speed_lag_s)
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
def _move_water(
    station: Floats,
    station_state: Floats,
    pump_state: Floats,
    curves: Floats,
    static_head_m: float,
    friction_h2_m5: float,
) -> None:
    """Set the flows after the second and their means over it; let the air at high points grow or be purged."""
    inertia_m_m3h = station[at.INERTIA] / 3600.0 * INERTIA_STEPS
    steps = INERTIA_STEPS if inertia_m_m3h > 0.0 else 1
    speed_ratio = pump_state[at.SPEED_RATIO]
    flow_m3h = pump_state[at.FLOW_NOW]
    mean_m3h = pump_state[at.MEAN_FLOW]
    total_m3h = 0.0
    for i in range(mean_m3h.size):
        mean_m3h[i] = 0.0
    for _ in range(steps):
        if station[at.IS_COMMON_HEADER] > 0.0:
            own_h2_m5 = friction_h2_m5 * (1.0 - station[at.SHARED_FRICTION])
            for i in range(mean_m3h.size):
                curves[i, 2] -= own_h2_m5
            shared_h2_m5 = friction_h2_m5 * station[at.SHARED_FRICTION]
            common_flows(curves, speed_ratio, static_head_m, shared_h2_m5, inertia_m_m3h, flow_m3h)
            for i in range(mean_m3h.size):
                curves[i, 2] += own_h2_m5
        else:
            individual_flows(curves, speed_ratio, static_head_m, friction_h2_m5, inertia_m_m3h, flow_m3h)
        for i in range(mean_m3h.size):
            mean_m3h[i] += flow_m3h[i] / steps
            total_m3h += flow_m3h[i]
    if station[at.AIR_HEAD] > 0.0:
        if total_m3h > 0.0:
            station_state[at.AIR] -= station_state[at.AIR] / station[at.AIR_PURGE]
        else:
            station_state[at.AIR] += (station[at.AIR_HEAD] - station_state[at.AIR]) / station[at.AIR_GROWTH]


@compiled
def _back_flow_m3h(
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
            head_m = static_head_m
            if station[at.IS_COMMON_HEADER] > 0.0:
                total_m3h = 0.0
                for k in range(pump.shape[1]):
                    total_m3h += pump_state[at.MEAN_FLOW, k]
                head_m += friction_h2_m5 * total_m3h**2
            back_m3h += leak_m3h * math.sqrt(head_m)
    return back_m3h


@compiled
def _load_pumps(
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
        head_m = 0.0
        power_kw = 0.0
        if shaft_ratio > 0.0:  # a standing pump reads 0, also while the water still moves through it
            head_m = pump_head_m(curves[i, 0], curves[i, 1], curves[i, 2], pump_state[at.SPEED_RATIO, i], flow_m3h)
        if shaft_ratio > 0.0:
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


@compiled
def _send(
    channel: int,
    reading: float,
    is_frozen: bool,
    now_s: int,
    sensor: Floats,
    channel_state: Floats,
    past: Floats,
    measured: Floats,
    second: int,
) -> None:
    """Record the telemetry of a reading; a frozen PLC repeats what it has sent last."""
    if not is_frozen or math.isnan(channel_state[at.LAST_SENT, channel]):
        transmit(channel, reading, now_s, sensor, channel_state, past)
    measured[channel, second] = channel_state[at.LAST_SENT, channel]


@compiled
def _supervise(
    station: Floats,
    pump: Floats,
    levels: Floats,
    station_state: Floats,
    pump_state: Floats,
    pump_force: Floats,
    second: int,
    started: Integers,
    recent_starts: Integers,
    counters: Integers,
    level_m: float,
) -> None:
    """Let the controller command at most one start or stop; pumps that are off or tripped are released first."""
    running = 0
    for k in range(counters[at.RUNNING]):
        i = started[k]
        if pump[at.IS_AUTOMATIC, i] > 0.0 and pump_force[at.IS_TRIPPED, i, second] <= 0.0:
            started[running] = i
            running += 1
        else:
            pump_state[at.IS_COMMANDED, i] = 0.0
            pump_state[at.DWELL_LEFT, i] = station[at.DWELL]
    change = wanted_change(level_m, running, levels[at.START_LEVEL], levels[at.STOP_LEVEL])
    if change > 0:
        i = _next_pump(station, pump, pump_state, pump_force, second, recent_starts, counters)
        if i != NOTHING:
            pump_state[at.IS_COMMANDED, i] = 1.0
            started[running] = i
            running += 1
            counters[at.TURN] = (i + 1) % pump.shape[1]
    elif change < 0:
        running -= 1
        pump_state[at.IS_COMMANDED, started[running]] = 0.0
        pump_state[at.DWELL_LEFT, started[running]] = station[at.DWELL]
    counters[at.RUNNING] = running
    if station[at.IS_PID] > 0.0:
        _control_level(station, pump, station_state, running, started, level_m)


@compiled
def _next_pump(
    station: Floats,
    pump: Floats,
    pump_state: Floats,
    pump_force: Floats,
    second: int,
    recent_starts: Integers,
    counters: Integers,
) -> int:
    """Pump that starts next, its start noted; -1 if none may."""
    pumps = pump.shape[1]
    limit = int(station[at.STARTS_PER_HOUR])
    for i in range(pumps):
        pump_state[at.IS_READY, i] = (
            pump[at.IS_AUTOMATIC, i] > 0.0
            and pump_force[at.IS_TRIPPED, i, second] <= 0.0
            and pump_state[at.IS_COMMANDED, i] <= 0.0
            and (limit == 0 or counters[at.SECOND] - recent_starts[i, limit - 1] >= SECONDS_PER_HOUR)
        )
    chosen = next_in_rotation(
        int(station[at.ROTATION]), counters[at.TURN], pump_state[at.RUN_TIME], pump_state[at.IS_READY]
    )
    if chosen != NOTHING:
        for k in range(recent_starts.shape[1] - 1, 0, -1):
            recent_starts[chosen, k] = recent_starts[chosen, k - 1]
        recent_starts[chosen, 0] = counters[at.SECOND]
    return chosen


@compiled
def _control_level(
    station: Floats, pump: Floats, station_state: Floats, running: int, started: Integers, level_m: float
) -> None:
    """Set the frequency that commanded pumps go to; the controller rests while no pump is commanded."""
    if running == 0:
        station_state[at.PID_SUM] = 0.0
        station_state[at.PID_HAS_LAST] = 0.0
        return
    station_state[at.WANTED_FREQUENCY] = controlled_frequency_hz(
        level_m,
        station[at.PID_LEVEL],
        station[at.PID_GAIN],
        station[at.PID_INTEGRAL],
        station[at.PID_DERIVATIVE],
        station[at.MIN_FREQUENCY],
        pump[at.NOMINAL_FREQUENCY, started[0]],
        station_state[at.PID_SUM : at.PID_HAS_LAST + 1],
    )


@compiled
def _drive(
    station: Floats, pump: Floats, pump_state: Floats, pump_force: Floats, second: int, wanted_hz: float
) -> None:
    """Move each drive on by a second; a tripped drive loses its pump at once."""
    for i in range(pump.shape[1]):
        frequency_hz = pump_state[at.FREQUENCY_NOW, i]
        is_commanded = pump_state[at.IS_COMMANDED, i] > 0.0
        if frequency_hz <= 0.0 and not is_commanded:
            continue
        if frequency_hz > 0.0:
            pump_state[at.RUN_TIME, i] += 1.0
        if pump_force[at.IS_TRIPPED, i, second] > 0.0:
            pump_state[at.FREQUENCY_NOW, i] = 0.0
            continue
        nominal_hz = pump[at.NOMINAL_FREQUENCY, i]
        pump_state[at.FREQUENCY_NOW, i] = next_frequency_hz(
            frequency_hz,
            is_commanded,
            nominal_hz / station[at.RAMP],
            station[at.MIN_FREQUENCY],
            min(wanted_hz, nominal_hz),
            pump_state[at.DWELL_LEFT, i],
        )
        if not is_commanded and pump_state[at.FREQUENCY_NOW, i] <= station[at.MIN_FREQUENCY]:
            pump_state[at.DWELL_LEFT, i] -= 1.0
