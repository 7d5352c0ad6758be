"""What acts on a plant in a block of seconds: the hook of faults, and of effects that change with time."""

from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.simulator.telemetry.channels import channels


class Forcing(NamedTuple):
    """What acts on the plant in a block of n seconds, to be worked into in place.

    Inflow and voltage are (n,); friction and static head (mains, n); factors and leaks of the pumps (pumps, n).
    Factors are 1, rises and leaks 0 in health. `is_plc_frozen` stops the PLC's program: outputs and telemetry stay as
    they are. `clock_s` (n,) are seconds since 1970, UTC; `columns` (columns, n) are those of a user that corrections
    go by, NaN is "no value". The sensor arrays are (channels, n), or (channels, 1) where not `has_sensor_faults`: a
    bias in units of the channel, a factor on its noise, and whether it is stuck.
    """

    inflow_m3h: Floats
    friction_factor: Floats
    static_rise_m: Floats
    voltage_factor: Floats
    is_plc_frozen: Flags
    speed_factor: Floats
    head_factor: Floats
    internal_leak_m3h: Floats
    valve_leak_m3h: Floats
    is_tripped: Flags
    clock_s: Floats
    columns: Floats
    has_sensor_faults: bool
    sensor_bias: Floats
    sensor_noise_factor: Floats
    is_sensor_stuck: Flags


def healthy_forcing(
    inflow_m3h: Floats,
    pumps: int,
    mains: int,
    *,
    with_sensors: bool = False,
    clock_s: Floats | None = None,
    columns: Floats | None = None,
) -> Forcing:
    """Forcing without any fault.

    Parameters
    ----------
    inflow_m3h : (n,) array
        [m³/h]
    pumps, mains : int
    with_sensors : bool
        Whether there is room for faults of the sensors.
    clock_s : (n,) array, optional
        Seconds since 1970, UTC; by default from 0 on. [s]
    columns : (columns, n) array, optional
        Of a user, that corrections go by.
    """
    seconds = inflow_m3h.size
    of_pumps = (pumps, seconds)
    of_channels = (channels(pumps), seconds if with_sensors else 1)
    return Forcing(
        inflow_m3h=inflow_m3h.copy(),
        friction_factor=np.ones((mains, seconds)),
        static_rise_m=np.zeros((mains, seconds)),
        voltage_factor=np.ones(seconds),
        is_plc_frozen=np.zeros(seconds, dtype=np.bool_),
        speed_factor=np.ones(of_pumps),
        head_factor=np.ones(of_pumps),
        internal_leak_m3h=np.zeros(of_pumps),
        valve_leak_m3h=np.zeros(of_pumps),
        is_tripped=np.zeros(of_pumps, dtype=np.bool_),
        clock_s=np.arange(seconds, dtype=np.float64) if clock_s is None else clock_s,
        columns=np.zeros((0, seconds)) if columns is None else columns,
        has_sensor_faults=with_sensors,
        sensor_bias=np.zeros(of_channels),
        sensor_noise_factor=np.ones(of_channels),
        is_sensor_stuck=np.zeros(of_channels, dtype=np.bool_),
    )
