"""From the true value to the telemetry: the sensor itself, then the way of its value to the recording."""

import math

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import inlined
from wetwell.protocols.quantities import LEVEL
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.parameters import SensorParameters
from wetwell.simulator.state import ChannelState

RESTING = 1e-6
"""A damped reading under this value counts as zero once its pump stands."""


@inlined
def sense(
    channel: int,
    true_value: float,
    is_active: bool,
    sensor: SensorParameters,
    state: ChannelState,
    forcing: Forcing,
    second: int,
    rng: np.random.Generator,
) -> float:
    """Reading of one channel in one second of the forcing.

    A pump channel that is not active (its pump stands and no water moves) reads exactly 0, once its damping has run
    out. A stuck sensor repeats its last reading; its noise is drawn all the same, so that nothing else changes.
    """
    if sensor.followed < 1.0:
        before, last, value = state.damped, state.undamped, true_value
        true_value = state.damped = follow(before, last, value, sensor)
        if sensor.carried > 0.0:
            true_value = state.damped_again = follow_again(state.damped_again, before, last, value, sensor)
        state.undamped = value
        is_active = is_active or true_value > RESTING
    reading = 0.0
    if is_active:
        noise = rng.standard_normal()
        correlation = sensor.correlation
        if correlation > 0.0:
            noise = correlation * state.last_noise + math.sqrt(1.0 - correlation**2) * noise
            state.last_noise = noise
        noise *= sensor.noise * forcing.sensor_noise_factor[channel, second]
        reading = sensor.gain * true_value + sensor.offset
        reading += forcing.sensor_bias[channel, second]
        reading = reading + noise if channel == LEVEL else reading * (1.0 + noise)
        if reading < sensor.cutoff:
            reading = 0.0
    if forcing.is_sensor_stuck[channel, second] and not math.isnan(state.last_reading):
        return state.last_reading
    state.last_reading = reading
    return reading


@inlined
def follow(damped: float, last: float, value: float, sensor: SensorParameters) -> float:
    """Output of a first-order lag a second later, its input gone from its last to a value; it begins at its first."""
    if math.isnan(damped):
        return value
    return value + (damped - value) * (1.0 - sensor.followed) + (last - value) * sensor.late


@inlined
def follow_again(damped: float, before: float, last: float, value: float, sensor: SensorParameters) -> float:
    """Output of a second lag in a row a second later, of which the first had `before`."""
    if math.isnan(damped) or math.isnan(before):
        return value
    moved = value + (damped - value) * (1.0 - sensor.followed_again)
    return moved + (before - value) * sensor.carried + (last - value) * sensor.late_again


@inlined
def transmit(reading: float, now_s: int, sensor: SensorParameters, state: ChannelState, past: Floats) -> None:
    """Send a reading on its way: delayed, rounded, held within the deadband; `last_sent` is what arrives.

    A delay between whole seconds is read between the two readings around it.
    """
    value = reading
    if sensor.delay_s > 0.0:
        value = delayed(past, reading, now_s, sensor.delay_s)
    if sensor.quantum > 0.0:
        value = math.floor(value / sensor.quantum + 0.5) * sensor.quantum
    if sensor.deadband > 0.0 and abs(value - state.last_sent) < sensor.deadband:
        return
    state.last_sent = value


@inlined
def delayed(past: Floats, value: float, second: int, delay_s: float) -> float:
    """Value of `delay_s` seconds ago, from a ring of past ones into which the present one goes.

    Parameters
    ----------
    past : (m,) array
        Ring, NaN where nothing has been; m >= delay_s + 2.
    value : float
        Present value.
    second : int
        Counts up by one a call.
    delay_s : float
        >= 0. [s]
    """
    size = past.size
    past[second % size] = value
    whole = int(delay_s)
    share = delay_s - whole
    near = past[(second - whole) % size]
    far = past[(second - whole - 1) % size]
    if math.isnan(near):
        return value
    return float(near if share == 0.0 or math.isnan(far) else (1.0 - share) * near + share * far)
