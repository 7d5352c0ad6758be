"""Telemetry: what the sensors read goes to the recording, second by second."""

import math

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import inlined
from wetwell.protocols.quantities import FLOW, FREQUENCY, HEAD, POWER
from wetwell.simulator.corrections.parts import FLOW_READING, HEAD_READING
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.parameters import PlantRecords, SensorParameters
from wetwell.simulator.records import Records
from wetwell.simulator.state import PlantState, Truth
from wetwell.simulator.telemetry.channels import pump_channel
from wetwell.simulator.telemetry.sensors import sense, transmit


@inlined
def is_plain_telemetry(sensors: Records[SensorParameters]) -> bool:
    """Whether an idle pump's channels just read 0: nothing damped, delayed or held."""
    for k in range(sensors.size):
        if sensors[k].followed < 1.0 or sensors[k].delay_s > 0.0 or sensors[k].deadband > 0.0:
            return False
    return True


@inlined
def read_channel(
    channel: int,
    true_value: float,
    is_active: bool,
    is_frozen: bool,
    plant: PlantRecords,
    state: PlantState,
    forcing: Forcing,
    second: int,
    rng: np.random.Generator,
    measured: Floats,
) -> float:
    """Read and send a channel; its reading."""
    at_force = second if forcing.has_sensor_faults else 0
    reading = sense(
        channel, true_value, is_active, plant.sensors[channel], state.channels[channel], forcing, at_force, rng
    )
    send(channel, reading, is_frozen, plant, state, measured, second)
    return reading


@inlined
def read_pumps(
    is_frozen: bool,
    may_rest: bool,
    plant: PlantRecords,
    state: PlantState,
    forcing: Forcing,
    second: int,
    rng: np.random.Generator,
    truth: Truth,
    measured: Floats,
) -> None:
    """Read and send frequency, flow, head and power of each pump; the channels of a standing one may rest at 0."""
    for i in range(state.pumps.size):
        frequency_hz = state.pumps[i].frequency_hz
        is_active = frequency_hz > 0.0 or state.mean_flow_m3h[i] > 0.0
        channel = pump_channel(FREQUENCY, i)
        if may_rest and not is_active:
            silence(state, channel, pump_channel(FREQUENCY, i + 1))
            continue
        send(channel, frequency_hz, is_frozen, plant, state, measured, second)
        head_m = truth.head_m[i, second]
        head_m += state.correction[HEAD_READING, i] if head_m > 0.0 else 0.0
        for quantity, value in (
            (FLOW, truth.flow_m3h[i, second] * (1.0 + state.correction[FLOW_READING, i])),
            (HEAD, head_m),
            (POWER, truth.power_kw[i, second]),
        ):
            channel = pump_channel(quantity, i)
            read_channel(channel, value, is_active, is_frozen, plant, state, forcing, second, rng, measured)


@inlined
def send(
    channel: int,
    reading: float,
    is_frozen: bool,
    plant: PlantRecords,
    state: PlantState,
    measured: Floats,
    second: int,
) -> None:
    """Record the telemetry of a reading; a frozen PLC repeats what it has sent last."""
    sent = state.channels[channel]
    if not is_frozen or math.isnan(sent.last_sent):
        transmit(reading, state.station[0].second, plant.sensors[channel], sent, state.past[channel])
    measured[channel, second] = sent.last_sent


@inlined
def silence(state: PlantState, first: int, end: int) -> None:
    """Let the sensors and the telemetry of channels of standing pumps read 0."""
    for channel in range(first, end):
        state.channels[channel].last_reading = 0.0
        state.channels[channel].last_sent = 0.0
