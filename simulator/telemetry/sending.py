"""Telemetry: what the sensors read goes to the recording, second by second."""

import math

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import FLOW, FREQUENCY, HEAD, POWER
from wetwell.simulator import layout as at
from wetwell.simulator.telemetry.channels import pump_channel
from wetwell.simulator.telemetry.sensors import sense, transmit


@compiled
def is_plain_telemetry(sensor: Floats) -> bool:
    """Whether an idle pump's channels just read 0: nothing damped, delayed or held."""
    for k in range(sensor.shape[1]):
        if sensor[at.FOLLOWED, k] < 1.0 or sensor[at.DELAY, k] > 0.0 or sensor[at.DEADBAND, k] > 0.0:
            return False
    return True


@compiled
def read_pumps(
    pump_state: Floats,
    pump_truth: Floats,
    is_frozen: bool,
    may_rest: bool,
    now_s: int,
    sensor: Floats,
    channel_state: Floats,
    past: Floats,
    sensor_force: Floats,
    at_force: int,
    rng: np.random.Generator,
    measured: Floats,
    second: int,
) -> None:
    """Read and send frequency, flow, head and power of each pump; the channels of a standing one may rest at 0."""
    for i in range(pump_state.shape[1]):
        frequency_hz = pump_state[at.FREQUENCY_NOW, i]
        is_active = frequency_hz > 0.0 or pump_state[at.MEAN_FLOW, i] > 0.0
        channel = pump_channel(FREQUENCY, i)
        if may_rest and not is_active:
            silence(channel_state, channel, pump_channel(FREQUENCY, i + 1))
            continue
        send(channel, frequency_hz, is_frozen, now_s, sensor, channel_state, past, measured, second)
        for quantity, row in ((FLOW, at.TRUE_FLOW), (HEAD, at.TRUE_HEAD), (POWER, at.TRUE_POWER)):
            channel = pump_channel(quantity, i)
            value = pump_truth[row, i, second]
            reading = sense(channel, value, is_active, sensor, channel_state, sensor_force, at_force, rng)
            send(channel, reading, is_frozen, now_s, sensor, channel_state, past, measured, second)


@compiled
def send(
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
def silence(channel_state: Floats, first: int, end: int) -> None:
    """Let the sensors and the telemetry of channels of standing pumps read 0."""
    for channel in range(first, end):
        channel_state[at.LAST_READING, channel] = 0.0
        channel_state[at.LAST_SENT, channel] = 0.0
