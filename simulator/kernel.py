"""The plant, second by second: one compiled loop, the same for a live second and for a batch of days."""

import numpy as np

from wetwell.simulator.control import NOTHING, next_in_rotation, wanted_change
from wetwell.simulator.drive import next_frequency_hz
from wetwell.simulator.hydraulics import common_flows, individual_flows, pump_head_m
from wetwell.simulator.jit import compiled
from wetwell.simulator.plant import Forcing, PlantParameters, PlantState, Record
from wetwell.simulator.power import electrical_power_kw
from wetwell.simulator.wet_well import next_level_m


@compiled
def advance(
    parameters: PlantParameters, state: PlantState, forcing: Forcing, rng: np.random.Generator, record: Record
) -> None:
    """Advance a plant by as many seconds as the forcing has, one PLC scan a second.

    In each second: the sensors are read; flows and heads follow from the frequencies that the drives have; the level
    integrates the balance; the controller acts on the level just measured; the drives move on. So that a start
    command at second t shows as a frequency from second t + 1 on.

    The noise is drawn in a fixed order (level, inflow, then flow, head and power of each running pump), so that
    blocks of any length give the same numbers.
    """
    pumps = state.frequency_hz.size
    speed_ratio = np.empty(pumps)
    flow_m3h = np.empty(pumps)
    for second in range(forcing.inflow_m3h.size):
        level_m = state.level_m[0]
        inflow_m3h = forcing.inflow_m3h[second]
        static_head_m = parameters.static_head_m + forcing.static_rise_m[second]
        friction_h2_m5 = parameters.friction_h2_m5 * forcing.friction_factor[second]
        for i in range(pumps):
            commanded_ratio = state.frequency_hz[i] / parameters.nominal_frequency_hz[i]
            speed_ratio[i] = commanded_ratio * forcing.speed_factor[i, second]
        if parameters.is_common_header:
            common_flows(parameters.curves, speed_ratio, static_head_m, friction_h2_m5, flow_m3h)
        else:
            individual_flows(parameters.curves, speed_ratio, static_head_m, friction_h2_m5, flow_m3h)
        state.level_m[0] = next_level_m(level_m, inflow_m3h, flow_m3h, parameters.area_m2)

        measured_level_m = level_m + parameters.level_noise_m * rng.standard_normal()
        record.level_m[second] = measured_level_m
        record.true_level_m[second] = level_m
        record.inflow_m3h[second] = inflow_m3h * (1.0 + parameters.inflow_noise * rng.standard_normal())
        for i in range(pumps):
            record.frequency_hz[i, second] = state.frequency_hz[i]
            record.true_flow_m3h[i, second] = flow_m3h[i]
            if state.frequency_hz[i] <= 0.0:
                record.flow_m3h[i, second] = 0.0
                record.head_m[i, second] = 0.0
                record.power_kw[i, second] = 0.0
                record.true_head_m[i, second] = 0.0
                continue
            curve = parameters.curves[i]
            head_m = pump_head_m(curve[0], curve[1], curve[2], speed_ratio[i], flow_m3h[i])
            power_kw = electrical_power_kw(
                parameters.voltage_v,
                parameters.rated_current_a,
                parameters.power_factor,
                state.frequency_hz[i] / parameters.nominal_frequency_hz[i],
            )
            record.true_head_m[i, second] = head_m
            record.flow_m3h[i, second] = flow_m3h[i] * (1.0 + parameters.flow_noise * rng.standard_normal())
            record.head_m[i, second] = head_m * (1.0 + parameters.head_noise * rng.standard_normal())
            record.power_kw[i, second] = power_kw * (1.0 + parameters.power_noise * rng.standard_normal())

        _supervise(parameters, state, measured_level_m)
        _drive(parameters, state)


@compiled
def _supervise(parameters: PlantParameters, state: PlantState, measured_level_m: float) -> None:
    """Let the controller command at most one start or stop; pumps that are switched off are released first."""
    pumps = state.frequency_hz.size
    running = 0
    for k in range(state.counters[0]):
        pump = state.started[k]
        if parameters.is_automatic[pump]:
            state.started[running] = pump
            running += 1
        else:
            state.is_commanded[pump] = False
            state.dwell_left_s[pump] = parameters.dwell_s
    change = wanted_change(measured_level_m, running, parameters.start_levels_m, parameters.stop_levels_m)
    if change > 0:
        pump = next_in_rotation(state.counters[1], state.is_commanded, parameters.is_automatic)
        if pump != NOTHING:
            state.is_commanded[pump] = True
            state.started[running] = pump
            running += 1
            state.counters[1] = (pump + 1) % pumps
    elif change < 0:
        running -= 1
        state.is_commanded[state.started[running]] = False
        state.dwell_left_s[state.started[running]] = parameters.dwell_s
    state.counters[0] = running


@compiled
def _drive(parameters: PlantParameters, state: PlantState) -> None:
    """Move each drive on by a second."""
    for i in range(state.frequency_hz.size):
        nominal_hz = parameters.nominal_frequency_hz[i]
        state.frequency_hz[i] = next_frequency_hz(
            state.frequency_hz[i],
            state.is_commanded[i],
            nominal_hz / parameters.ramp_s,
            parameters.min_frequency_hz,
            nominal_hz,
            state.dwell_left_s[i],
        )
        if not state.is_commanded[i] and state.frequency_hz[i] <= parameters.min_frequency_hz:
            state.dwell_left_s[i] -= 1.0
