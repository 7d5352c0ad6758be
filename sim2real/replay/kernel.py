"""Teacher-forced replay, second by second: recorded frequency and inflow go in, an observer follows the level."""

import math

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.jit import compiled, inlined
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, HEAD, LEVEL, POWER
from wetwell.simulator.corrections.parts import FLOW_READING, HEAD_READING, LEVEL_READING, SUMP_AREA
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.kernel import move_plant
from wetwell.simulator.parameters import PlantRecords
from wetwell.simulator.state import PlantState, Truth
from wetwell.simulator.telemetry.channels import pump_channel
from wetwell.simulator.telemetry.sensors import RESTING, follow, follow_again
from wetwell.simulator.wet_well import level_at_volume_m, volume_at_level_m3


@compiled
def replay_seconds(
    plant: PlantRecords,
    state: PlantState,
    forcing: Forcing,
    damped: Floats,
    frequency_hz: Floats,
    measured_level_m: Floats,
    level_gain: Floats,
    inflow_gain: Floats,
    sensor_gain: Floats,
    inflow_kept: float,
    is_inlet_shut: Flags,
    span_s: int,
    truth: Truth,
    level_m: Floats,
    reading: Floats,
) -> None:
    r"""Go through the seconds of a recording with the plant of the simulator, its frequencies set.

    The true level is followed by an observer; with gains a second,

    $$A \frac{dL}{dt} = Q_{in} + b - \sum_i Q_i + A\,g\,e, \qquad \frac{db}{dt} = A\,g_b\,e - \frac{b}{T}, \qquad
    e = y - \hat y$$

    with y the recorded level, ŷ what the level sensor would read, lag included, at that second or as the mean of
    `span_s` seconds, and $e^{-1/T}$ the share of b that is kept for a second. A late level comes here earlier by the
    whole seconds of its delay; ŷ has the rest of it, by what the plant moves and not by what was corrected: that has
    the noise of the sensor.

    Parameters
    ----------
    plant, state, forcing
        As in the simulator's kernel.
    damped : (3, 3, pumps) array
        State of both filters of flow, head and power, and what came in last; to come as zeros.
    frequency_hz : (pumps, n) array
    measured_level_m : (n,) array
        NaN is "no value".
    level_gain, inflow_gain : (n,) arrays
        Shares of the error of a value of the level that move the level, and the inflow over the area. [1, 1/s]
    sensor_gain : (2, n) array
        The same of what the filters of the level sensor hold; of the second 1 begins anew. [1]
    inflow_kept : float
        Share of what was given to the inflow that is left after a second. [1]
    is_inlet_shut : (n,) array
        Whether nothing comes in that nobody measures.
    span_s : int
        Seconds that a value of the level is the mean of. [s]
    truth : Truth
        Room for one second.
    level_m : (n,) array
        Out: what the level sensor would read in each second, the rest of its delay included, before it is known what
        it read.
    reading : (3, pumps, n) array
        Out: flow, head and power as the sensors would read them without noise and delay; to come as zeros.
    """
    now, sensor = state.station[0], plant.sensors[LEVEL]
    extra_m3h = 0.0
    came_m = filtered_m = sensed_m = level_at_volume_m(now.volume_m3, plant.profile)
    share = sensor.delay_s - int(sensor.delay_s)
    was_moving, is_damped = True, _is_damped(plant)
    for second in range(forcing.inflow_m3h.size):
        for i in range(state.pumps.size):
            state.pumps[i].frequency_hz = frequency_hz[i, second]
        if was_moving:
            truth.flow_m3h[:] = truth.head_m[:] = truth.power_kw[:] = 0.0
        coming = 0.0 if is_inlet_shut[second] else 1.0
        is_moving = move_plant(plant, state, forcing, second, coming * extra_m3h, truth, 0)
        extra_m3h *= inflow_kept
        true_m = truth.level_m[0]
        misread_m = state.correction[LEVEL_READING, 0]
        if is_moving or was_moving or is_damped:
            _read(plant, state, damped, is_damped, second, truth, reading)
        was_moving = is_moving

        last_m, before_m, begun_m = came_m, filtered_m, sensed_m
        came_m = true_m + misread_m
        filtered_m = follow(before_m, last_m, came_m, sensor)
        sensed_m = follow_again(sensed_m, before_m, last_m, came_m, sensor) if sensor.carried > 0.0 else filtered_m
        expected_m = level_m[second] = sensed_m - share * (sensed_m - begun_m)
        if math.isnan(measured_level_m[second]):
            continue
        if span_s > 1:
            expected_m = 0.0
            for before in range(span_s):
                expected_m += level_m[max(second - before, 0)] / span_s
        error_m = measured_level_m[second] - expected_m
        if sensor_gain[1, second] >= 1.0:
            anew_m = max(measured_level_m[second] - misread_m, plant.profile[0].level_m)
            now.volume_m3 = volume_at_level_m3(anew_m, plant.profile)
            came_m = filtered_m = sensed_m = measured_level_m[second]
        else:
            area_m2 = (
                volume_at_level_m3(true_m + 0.01, plant.profile) - volume_at_level_m3(true_m, plant.profile)
            ) / 0.01
            corrected_m3 = now.volume_m3 + level_gain[second] * error_m * area_m2
            now.volume_m3 = max(corrected_m3, 0.0)
            came_m += level_gain[second] * error_m
            filtered_m += sensor_gain[0, second] * error_m
            sensed_m += sensor_gain[1, second] * error_m
            area_m2 *= 1.0 + state.correction[SUMP_AREA, 0]
            extra_m3h += coming * inflow_gain[second] * error_m * area_m2 * 3600.0


@inlined
def _is_damped(plant: PlantRecords) -> bool:
    """Whether any sensor of a pump tells of its running after that."""
    is_damped = False
    for channel in range(FIRST_PUMP, plant.sensors.size):
        is_damped = is_damped or plant.sensors[channel].followed < 1.0
    return is_damped


@inlined
def _read(
    plant: PlantRecords,
    state: PlantState,
    damped: Floats,
    is_damped: bool,
    second: int,
    truth: Truth,
    reading: Floats,
) -> None:
    """Read flow, head and power of each pump as its sensors do: damping, gain, offset, cutoff."""
    for i in range(state.pumps.size):
        is_active = state.pumps[i].frequency_hz > 0.0 or state.mean_flow_m3h[i] > 0.0
        if not is_active and not is_damped:
            continue
        head_m = truth.head_m[i, 0]
        head_m += state.correction[HEAD_READING, i] if head_m > 0.0 else 0.0
        flow_m3h = truth.flow_m3h[i, 0] * (1.0 + state.correction[FLOW_READING, i])
        for k, (quantity, true_value) in enumerate(((FLOW, flow_m3h), (HEAD, head_m), (POWER, truth.power_kw[i, 0]))):
            sensor = plant.sensors[pump_channel(quantity, i)]
            value = true_value
            is_seen = is_active
            if sensor.followed < 1.0:
                before, last, came = damped[0, k, i], damped[2, k, i], value
                value = damped[0, k, i] = follow(before, last, came, sensor)
                if sensor.carried > 0.0:
                    value = damped[1, k, i] = follow_again(damped[1, k, i], before, last, came, sensor)
                damped[2, k, i] = came
                is_seen = is_active or value > RESTING
            if is_seen:
                value = sensor.gain * value + sensor.offset
                if value >= sensor.cutoff:
                    reading[k, i, second] = value
