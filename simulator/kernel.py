"""The plant, second by second: one compiled loop, the same for a live second and for a batch of days."""

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled, inlined
from wetwell.protocols.orders import Orders, go_on, valves
from wetwell.protocols.quantities import FIRST_PUMP, INFLOW, LEVEL
from wetwell.simulator.control.drive import slipped, turned_ratio
from wetwell.simulator.control.supervision import drive, supervise
from wetwell.simulator.corrections.acting import correct
from wetwell.simulator.corrections.parts import (
    LEVEL_BALANCE,
    LEVEL_READING,
    POWER_TERM,
    PUMP_HEAD,
    SPEED,
    SUMP_AREA,
)
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.hydraulics import pump_head_m
from wetwell.simulator.parameters import PlantRecords
from wetwell.simulator.power import electrical_power_kw, loaded_power_kw, shaft_power_kw
from wetwell.simulator.rising_main.flows import back_flow_m3h, gather_air, move_water
from wetwell.simulator.state import PlantState, Truth
from wetwell.simulator.telemetry.sending import is_plain_telemetry, read_channel, read_pumps, silence
from wetwell.simulator.telemetry.sensors import delayed
from wetwell.simulator.wet_well import daily_swing_m3h, level_at_volume_m, next_volume_m3, overflow_m3h


@compiled
def simulate_seconds(
    plant: PlantRecords,
    state: PlantState,
    forcing: Forcing,
    orders: Orders,
    rng: np.random.Generator,
    measured: Floats,
    truth: Truth,
) -> None:
    """Advance a plant by as many seconds as the forcing has, one PLC scan a second.

    In each second: flows and heads follow from the frequencies that the drives have; the volume integrates the
    balance; the sensors are read; the controller acts on the level that it sees; the drives move on. So that a start
    command at second t shows as a frequency from second t + 1 on. Flows and heads are means over the second, which
    is the same as their value at its beginning where the water has no inertia.

    `measured` and the pumps of `truth` are to come as zeros: a pump that stands leaves them so, and while all pumps
    stand and no water moves nothing is computed for them. Most seconds of most stations are of this kind.

    An operator's orders go before the controller: a step that begins at second t shows as a start command does.

    The noise is drawn in a fixed order (level, inflow, then flow, head and power of each active pump), so that
    blocks of any length give the same numbers.
    """
    station, now = plant.station[0], state.station[0]
    is_plain = not forcing.has_sensor_faults and is_plain_telemetry(plant.sensors)
    is_silent = False
    for second in range(forcing.inflow_m3h.size):
        truth.step[second] = state.place[2]
        if state.place[2] >= 0:
            _set_valves(forcing, orders, state.place[2], second)
        is_moving = move_plant(plant, state, forcing, second, 0.0, truth, second)

        is_frozen = forcing.is_plc_frozen[second]
        inflow_m3h = forcing.inflow_m3h[second]
        level_m = truth.level_m[second] + state.correction[LEVEL_READING, 0]
        seen_level_m = read_channel(LEVEL, level_m, True, is_frozen, plant, state, forcing, second, rng, measured)
        read_channel(INFLOW, inflow_m3h, True, is_frozen, plant, state, forcing, second, rng, measured)
        may_rest = is_plain and not is_frozen
        if is_moving or not may_rest:
            read_pumps(is_frozen, may_rest, plant, state, forcing, second, rng, truth, measured)
            is_silent = False
        elif not is_silent:
            silence(state, FIRST_PUMP, state.channels.size)
            is_silent = True

        if not is_frozen:
            if station.control_delay_s > 0.0:
                seen_level_m = delayed(state.level_history, seen_level_m, now.second, station.control_delay_s)
            supervise(plant, state, forcing, orders, go_on(orders, state.place, seen_level_m), second, seen_level_m)
        drive(plant, state, forcing, orders, second)
        now.second += 1


@inlined
def _set_valves(forcing: Forcing, orders: Orders, step: int, second: int) -> None:
    """Work valves that a step shuts into what acts on the plant."""
    loss, inlet = valves(orders, step)
    for m in range(forcing.friction_factor.shape[0]):
        forcing.friction_factor[m, second] *= loss
    forcing.inflow_m3h[second] *= inlet


@inlined
def move_plant(
    plant: PlantRecords,
    state: PlantState,
    forcing: Forcing,
    second: int,
    extra_inflow_m3h: float,
    truth: Truth,
    at_truth: int,
) -> bool:
    """Move pumps and water on by a second, and note the truth; whether any pump turned or had water moving in it."""
    station, now = plant.station[0], state.station[0]
    level_m = level_at_volume_m(now.volume_m3, plant.profile)
    is_moving = is_moving_now(state)
    if plant.has_corrections:
        correct(plant, state, forcing, second, level_m)
    if is_moving:
        turn_pumps(plant, state, forcing, second)
        for m in range(plant.mains.size):
            move_water(plant, state, forcing, second, m, level_m)
    if plant.has_air:
        for m in range(plant.mains.size):
            gather_air(plant, state, m)
    over_m3h = overflow_m3h(level_m, station.overflow_level_m, station.weir_width_m, plant.profile)
    unmetered_m3h = station.unmetered_inflow_m3h
    unmetered_m3h += daily_swing_m3h(
        station.unmetered_cosine_m3h, station.unmetered_sine_m3h, forcing.clock_s[second]
    )
    inflow_m3h = forcing.inflow_m3h[second] + unmetered_m3h + extra_inflow_m3h
    inflow_m3h += state.correction[LEVEL_BALANCE, 0]
    inflow_m3h += back_flow_m3h(plant, state, forcing, second, level_m)
    before_m3 = now.volume_m3
    now.volume_m3 = next_volume_m3(before_m3, inflow_m3h, over_m3h, state.mean_flow_m3h)
    if plant.has_corrections:
        now.volume_m3 = before_m3 + (now.volume_m3 - before_m3) / (1.0 + state.correction[SUMP_AREA, 0])
    if is_moving:
        load_pumps(plant, state, forcing.voltage_factor[second], truth, at_truth)
    truth.level_m[at_truth] = level_m
    truth.overflow_m3h[at_truth] = over_m3h
    return is_moving


@inlined
def is_moving_now(state: PlantState) -> bool:
    """Whether any pump is driven, turns, or has water moving in it, now or in the second before."""
    for i in range(state.pumps.size):
        pump = state.pumps[i]
        if (
            pump.frequency_hz > 0.0
            or pump.shaft_ratio > 0.0
            or state.flow_m3h[i] > 0.0
            or state.mean_flow_m3h[i] > 0.0
        ):
            return True
    return False


@inlined
def turn_pumps(plant: PlantRecords, state: PlantState, forcing: Forcing, second: int) -> None:
    """Set the curve of each pump, and the speed that the water sees: command, ramp, slip, ragging, blockage."""
    station = plant.station[0]
    for i in range(state.pumps.size):
        pump, now = plant.pumps[i], state.pumps[i]
        now.shaft_ratio = turned_ratio(
            now.frequency_hz / pump.nominal_frequency_hz,
            now.shaft_ratio,
            station.ramp_power,
            station.speed_lag_s,
            station.ramp_bow,
            station.ramp_ahead,
            station.ramp_knee,
        )
        if now.shaft_ratio <= 0.0:
            state.speed_ratio[i] = 0.0
            now.ragging = 0.0
            if state.flow_m3h[i] <= 0.0:
                continue
        factor = forcing.speed_factor[i, second] * (1.0 + state.correction[SPEED, i])
        factor *= 1.0 - pump.ragging_speed_loss * now.ragging
        flow_m3h = max(state.flow_m3h[i], 0.0)
        speed_ratio, fall_h_m3 = slipped(
            now.shaft_ratio, flow_m3h, pump.slip, pump.shutoff_power_share, pump.rated_flow_m3h
        )
        state.speed_ratio[i] = speed_ratio * factor
        falling = fall_h_m3 * factor
        factor = forcing.head_factor[i, second] * (1.0 + state.correction[PUMP_HEAD, i])
        leak_m3h = forcing.internal_leak_m3h[i, second]
        state.curves[i, 0] = factor * (pump.c0 + (pump.c1 + pump.c2 * leak_m3h) * leak_m3h)
        state.curves[i, 1] = factor * (pump.c1 + 2.0 * pump.c2 * leak_m3h)
        state.curves[i, 2] = factor * pump.c2 - pump.ragging_h2_m5 * now.ragging
        if falling > 0.0:  # N = N0 - b Q in the affinity laws
            c0, c1 = state.curves[i, 0], state.curves[i, 1]
            state.curves[i, 1] -= 2.0 * c0 * falling
            state.curves[i, 2] += (c0 * falling - c1) * falling
        now.ragging += (1.0 - now.ragging) * (flow_m3h / pump.rated_flow_m3h) / pump.ragging_s


@inlined
def load_pumps(plant: PlantRecords, state: PlantState, voltage_factor: float, truth: Truth, second: int) -> None:
    """Note flow, head and power of each pump."""
    station = plant.station[0]
    for i in range(state.pumps.size):
        pump, now, curve, flow_m3h = plant.pumps[i], state.pumps[i], state.curves[i], state.mean_flow_m3h[i]
        if now.shaft_ratio <= 0.0 and flow_m3h <= 0.0:
            continue
        head_m = 0.0
        power_kw = 0.0
        if now.shaft_ratio > 0.0:  # a pump reads 0 where it stands, or the water moves on faster than it would pump
            head_m = max(pump_head_m(curve[0], curve[1], curve[2], state.speed_ratio[i], flow_m3h), 0.0)
            speed_ratio, fall_h_m3 = slipped(
                now.shaft_ratio, flow_m3h, pump.slip, pump.shutoff_power_share, pump.rated_flow_m3h
            )
            turned = (speed_ratio - fall_h_m3 * flow_m3h) / now.shaft_ratio
            turning = now.shaft_ratio * (1.0 + state.correction[SPEED, i]) * turned
            shaft_kw = shaft_power_kw(
                turning, flow_m3h, pump.rated_flow_m3h, pump.rated_shaft_kw, pump.shutoff_power_share
            )
            if now.frequency_hz > 0.0:
                by_load = station.load_share
                power_kw = (1.0 - by_load) * electrical_power_kw(
                    station.voltage_v,
                    station.rated_current_a,
                    station.power_factor,
                    now.frequency_hz / pump.nominal_frequency_hz,
                )
                if by_load > 0.0:
                    power_kw += by_load * loaded_power_kw(  # the field turns faster than the shaft, with its torque
                        shaft_kw / turned,
                        pump.rated_shaft_kw,
                        station.motor_efficiency,
                        station.drive_efficiency,
                        station.losses_share,
                    )
                power_kw *= voltage_factor * (1.0 + state.correction[POWER_TERM, i])
                if pump.slip_power_exponent > 0.0:
                    power_kw *= turned**pump.slip_power_exponent
        truth.flow_m3h[i, second] = flow_m3h
        truth.head_m[i, second] = head_m
        truth.power_kw[i, second] = power_kw
