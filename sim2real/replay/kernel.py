"""Teacher-forced replay, second by second: recorded frequency and inflow go in, an observer follows the level."""

import math

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FLOW, HEAD, LEVEL, POWER
from wetwell.simulator import layout as at
from wetwell.simulator.kernel import back_flow_m3h, gather_air, is_moving_now, load_pumps, move_water, turn_pumps
from wetwell.simulator.telemetry.channels import pump_channel
from wetwell.simulator.telemetry.sensors import RESTING
from wetwell.simulator.wet_well import level_at_volume_m, next_volume_m3, overflow_m3h, volume_at_level_m3

MOST_FOLLOWED = 0.5
"""Share of an error that one value may take away, however long there was none."""
LOST_S = 300
"""After that long without a level the observer begins anew."""


@compiled
def replay_seconds(
    station: Floats,
    pump: Floats,
    profile: Floats,
    sensor: Floats,
    station_state: Floats,
    pump_state: Floats,
    curves: Floats,
    damped: Floats,
    station_force: Floats,
    pump_force: Floats,
    frequency_hz: Floats,
    measured_level_m: Floats,
    level_gain: float,
    inflow_gain: float,
    pump_truth: Floats,
    level_m: Floats,
    reading: Floats,
) -> None:
    r"""Go through the seconds of a recording with the plant of the simulator, its frequencies set.

    The true level is followed by an observer with constant gains,

    $$A \frac{dL}{dt} = Q_{in} + b - \sum_i Q_i + A\,g\,e, \qquad \frac{db}{dt} = A\,g_b\,e, \qquad e = y - \hat y$$

    with y the recorded level and ŷ what the level sensor would read, lag and delay included.

    Parameters
    ----------
    station, pump, profile, sensor, station_state, pump_state, curves, station_force, pump_force
        As in the simulator's kernel; the inflow is a row of `station_force`.
    damped : (3, pumps) array
        State of the damping of flow, head and power; to come as zeros.
    frequency_hz : (pumps, n) array
    measured_level_m : (n,) array
        NaN is "no value".
    level_gain, inflow_gain : float
        g and g_b. [1/s, 1/s²]
    pump_truth : (3, pumps, 1) array
        Room for true flow, head and power of one second.
    level_m : (n,) array
        Out: what the level sensor would read in each second, before it is known what it read.
    reading : (3, pumps, n) array
        Out: flow, head and power as the sensors would read them without noise and delay.
    """
    extra_m3h = 0.0
    sensed_m = level_at_volume_m(station_state[at.VOLUME], profile)
    lost_s = 0
    delay_s = sensor[at.DELAY, LEVEL]
    whole = int(delay_s)
    share = delay_s - whole
    for second in range(station_force.shape[1]):
        for i in range(pump_state.shape[1]):
            pump_state[at.FREQUENCY_NOW, i] = frequency_hz[i, second]
        true_m = level_at_volume_m(station_state[at.VOLUME], profile)
        static_head_m = station[at.STATIC_HEAD] - station[at.LIFT_SLOPE] * (true_m - station[at.LIFT_REFERENCE])
        static_head_m += station_force[at.STATIC_RISE, second]
        friction_h2_m5 = station[at.FRICTION] * station_force[at.FRICTION_FACTOR, second]
        is_moving = is_moving_now(pump_state)
        if is_moving:
            turn_pumps(station, pump, pump_state, pump_force, second, curves)
            move_water(station, pump_state, curves, static_head_m, friction_h2_m5)
        if station[at.AIR_HEAD] > 0.0:
            gather_air(station, pump_state)
        over_m3h = overflow_m3h(true_m, station[at.OVERFLOW_LEVEL], station[at.WEIR_WIDTH], profile)
        inflow_m3h = station_force[at.INFLOW_FORCE, second] + station[at.UNMETERED_INFLOW] + extra_m3h
        inflow_m3h += back_flow_m3h(station, pump, pump_state, pump_force, second, static_head_m, friction_h2_m5)
        before_m3 = station_state[at.VOLUME]
        station_state[at.VOLUME] = next_volume_m3(before_m3, inflow_m3h, over_m3h, pump_state[at.MEAN_FLOW])
        pump_truth[:] = 0.0
        if is_moving:
            load_pumps(station, pump, pump_state, station_force[at.VOLTAGE_FACTOR, second], curves, 0, pump_truth)
        _read(sensor, pump_state, damped, second, pump_truth, reading)

        sensed_m += (true_m - sensed_m) * sensor[at.FOLLOWED, LEVEL]
        level_m[second] = sensed_m
        expected_m = sensed_m
        if delay_s > 0.0 and second > whole:
            expected_m = (1.0 - share) * level_m[second - whole] + share * level_m[second - whole - 1]
        if math.isnan(measured_level_m[second]):
            lost_s += 1
            continue
        error_m = measured_level_m[second] - expected_m
        followed = min(level_gain * (lost_s + 1), MOST_FOLLOWED)
        if lost_s > LOST_S:
            station_state[at.VOLUME] = volume_at_level_m3(max(measured_level_m[second], 0.0), profile)
            sensed_m = measured_level_m[second]
        else:
            area_m2 = (volume_at_level_m3(true_m + 0.01, profile) - volume_at_level_m3(true_m, profile)) / 0.01
            corrected_m3 = station_state[at.VOLUME] + followed * error_m * area_m2
            station_state[at.VOLUME] = max(corrected_m3, 0.0)
            sensed_m += followed * error_m
            extra_m3h += inflow_gain * error_m * area_m2 * 3600.0
        lost_s = 0


@compiled
def _read(
    sensor: Floats, pump_state: Floats, damped: Floats, second: int, pump_truth: Floats, reading: Floats
) -> None:
    """Read flow, head and power of each pump as its sensors do: damping, gain, offset, cutoff."""
    for i in range(pump_state.shape[1]):
        is_active = pump_state[at.FREQUENCY_NOW, i] > 0.0 or pump_state[at.MEAN_FLOW, i] > 0.0
        for quantity in range(3):
            channel = pump_channel((FLOW, HEAD, POWER)[quantity], i)
            value = pump_truth[quantity, i, 0]
            is_seen = is_active
            if sensor[at.FOLLOWED, channel] < 1.0:
                damped[quantity, i] += (value - damped[quantity, i]) * sensor[at.FOLLOWED, channel]
                value = damped[quantity, i]
                is_seen = is_active or value > RESTING
            reading[quantity, i, second] = 0.0
            if is_seen:
                value = sensor[at.GAIN, channel] * value + sensor[at.OFFSET, channel]
                if value >= sensor[at.CUTOFF, channel]:
                    reading[quantity, i, second] = value
