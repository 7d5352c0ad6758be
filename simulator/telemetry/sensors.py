"""From the true value to the telemetry: the sensor itself, then the way of its value to the recording."""

import math
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, HEAD, INFLOW, LEVEL, POWER
from wetwell.protocols.station.station_file import Sensors
from wetwell.simulator import layout as at
from wetwell.simulator.telemetry.channels import channels

MAX_DELAY_S = 119
RESTING = 1e-6
"""A damped reading under this value counts as zero once its pump stands."""


class SensorParameters(NamedTuple):
    r"""How each channel measures and transmits; arrays of one value a channel.

    The sensor: $y = g\, x_\tau + o$ with x damped by a first-order lag τ, then noise
    $y (1 + \sigma n)$ (the level: $y + \sigma n$) with $n$ white or AR(1), then 0 below a cutoff.
    The telemetry: a delay, rounding to a quantum, and a value that is held until it has moved by a deadband.
    """

    gain: Floats
    offset: Floats
    lag_s: Floats
    noise: Floats
    correlation: Floats
    cutoff: Floats
    delay_s: Floats
    quantum: Floats
    deadband: Floats


def sensor_parameters(sensors: Sensors, pumps: int) -> SensorParameters:
    """Parameters of the channels of a station."""
    count = channels(pumps)
    noise = np.zeros(count)
    noise[LEVEL] = sensors.level_noise_m
    noise[INFLOW] = sensors.inflow_noise
    noise[FIRST_PUMP + FLOW :: 4] = sensors.flow_noise
    noise[FIRST_PUMP + HEAD :: 4] = sensors.head_noise
    noise[FIRST_PUMP + POWER :: 4] = sensors.power_noise
    return SensorParameters(
        gain=np.ones(count),
        offset=np.zeros(count),
        lag_s=np.zeros(count),
        noise=noise,
        correlation=np.full(count, sensors.correlation),
        cutoff=np.full(count, -np.inf),
        delay_s=np.zeros(count),
        quantum=np.zeros(count),
        deadband=np.zeros(count),
    )


def followed_share(lag_s: float) -> float:
    r"""Share of a step that a first-order lag follows within a second.

    $$1 - e^{-1 / \tau}$$

    Examples
    --------
    >>> followed_share(0.0), round(followed_share(10.0), 4)
    (1.0, 0.0952)
    """
    return 1.0 if lag_s <= 0.0 else 1.0 - math.exp(-1.0 / lag_s)


@compiled
def sense(
    channel: int,
    true_value: float,
    is_active: bool,
    sensor: Floats,
    channel_state: Floats,
    force: Floats,
    second: int,
    rng: np.random.Generator,
) -> float:
    """Reading of one channel in one second; the arrays are those of `layout`.

    A pump channel that is not active (its pump stands and no water moves) reads exactly 0, once its damping has run
    out. A stuck sensor repeats its last reading; its noise is drawn all the same, so that nothing else changes.
    """
    followed = sensor[at.FOLLOWED, channel]
    if followed < 1.0:
        damped = channel_state[at.DAMPED, channel]
        if math.isnan(damped):
            damped = true_value
        damped += (true_value - damped) * followed
        channel_state[at.DAMPED, channel] = damped
        true_value = damped
        is_active = is_active or damped > RESTING
    reading = 0.0
    if is_active:
        noise = rng.standard_normal()
        correlation = sensor[at.CORRELATION, channel]
        if correlation > 0.0:
            noise = correlation * channel_state[at.LAST_NOISE, channel] + math.sqrt(1.0 - correlation**2) * noise
            channel_state[at.LAST_NOISE, channel] = noise
        noise *= sensor[at.NOISE, channel] * force[at.NOISE_FACTOR, channel, second]
        reading = sensor[at.GAIN, channel] * true_value + sensor[at.OFFSET, channel]
        reading += force[at.SENSOR_BIAS, channel, second]
        reading = reading + noise if channel == LEVEL else reading * (1.0 + noise)
        if reading < sensor[at.CUTOFF, channel]:
            reading = 0.0
    if force[at.IS_STUCK, channel, second] > 0.0 and not math.isnan(channel_state[at.LAST_READING, channel]):
        return float(channel_state[at.LAST_READING, channel])
    channel_state[at.LAST_READING, channel] = reading
    return reading


@compiled
def transmit(channel: int, reading: float, now_s: int, sensor: Floats, channel_state: Floats, past: Floats) -> None:
    """Send a reading on its way: delayed, rounded, held within the deadband; `LAST_SENT` is what arrives.

    A delay between whole seconds is read between the two readings around it.
    """
    value = reading
    delay_s = sensor[at.DELAY, channel]
    if delay_s > 0.0:
        value = delayed(past[channel], reading, now_s, delay_s)
    quantum = sensor[at.QUANTUM, channel]
    if quantum > 0.0:
        value = math.floor(value / quantum + 0.5) * quantum
    deadband = sensor[at.DEADBAND, channel]
    if deadband > 0.0 and abs(value - channel_state[at.LAST_SENT, channel]) < deadband:
        return
    channel_state[at.LAST_SENT, channel] = value


@compiled
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
