"""What the kernel works on: parameters and state of a plant, the forcing of a block, and its record."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wetwell.protocols.station import Station

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class PlantParameters(NamedTuple):
    """A station as the kernel reads it; the units are those of the station file."""

    area_m2: float
    curves: Floats
    nominal_frequency_hz: Floats
    static_head_m: float
    friction_h2_m5: float
    is_common_header: bool
    start_levels_m: Floats
    stop_levels_m: Floats
    is_automatic: Flags
    ramp_s: float
    min_frequency_hz: float
    dwell_s: float
    voltage_v: float
    rated_current_a: float
    power_factor: float
    flow_noise: float
    head_noise: float
    power_noise: float
    inflow_noise: float
    level_noise_m: float


class PlantState(NamedTuple):
    """State of a plant between two seconds, in arrays that the kernel changes in place.

    `started` holds the commanded pumps in the order of their starts; `counters` is (number of commanded pumps,
    pump that starts next).
    """

    level_m: Floats
    frequency_hz: Floats
    dwell_left_s: Floats
    is_commanded: Flags
    started: npt.NDArray[np.int64]
    counters: npt.NDArray[np.int64]


class Forcing(NamedTuple):
    """What acts on the plant in a block of n seconds: inflow, and what faults do to pumps and rising main.

    `speed_factor` is (pumps, n), the others are (n,).
    """

    inflow_m3h: Floats
    speed_factor: Floats
    friction_factor: Floats
    static_rise_m: Floats


class Record(NamedTuple):
    """What a block of n seconds brought, measured and true; (n,) or (pumps, n)."""

    level_m: Floats
    inflow_m3h: Floats
    frequency_hz: Floats
    flow_m3h: Floats
    head_m: Floats
    power_kw: Floats
    true_level_m: Floats
    true_flow_m3h: Floats
    true_head_m: Floats


def plant_parameters(station: Station) -> PlantParameters:
    """Parameters of a station."""
    return PlantParameters(
        area_m2=station.sump.area_m2,
        curves=np.array([pump.coefficients for pump in station.pump]),
        nominal_frequency_hz=np.array([pump.nominal_frequency_hz for pump in station.pump]),
        static_head_m=station.rising_main.static_head_m,
        friction_h2_m5=station.rising_main.friction_h2_m5,
        is_common_header=station.rising_main.layout == "common",
        start_levels_m=np.array(station.control.start_levels_m),
        stop_levels_m=np.array(station.control.stop_levels_m),
        is_automatic=np.ones(len(station.pump), dtype=np.bool_),
        ramp_s=station.control.ramp_s,
        min_frequency_hz=station.control.min_frequency_hz,
        dwell_s=station.control.dwell_s,
        voltage_v=station.electrical.voltage_v,
        rated_current_a=station.electrical.rated_current_a,
        power_factor=station.electrical.power_factor,
        flow_noise=station.sensors.flow_noise,
        head_noise=station.sensors.head_noise,
        power_noise=station.sensors.power_noise,
        inflow_noise=station.sensors.inflow_noise,
        level_noise_m=station.sensors.level_noise_m,
    )


def plant_at_rest(pumps: int, level_m: float) -> PlantState:
    """State with all pumps standing."""
    return PlantState(
        level_m=np.array([level_m]),
        frequency_hz=np.zeros(pumps),
        dwell_left_s=np.zeros(pumps),
        is_commanded=np.zeros(pumps, dtype=np.bool_),
        started=np.zeros(pumps, dtype=np.int64),
        counters=np.zeros(2, dtype=np.int64),
    )


def healthy_forcing(inflow_m3h: Floats, pumps: int) -> Forcing:
    """Forcing without any fault."""
    seconds = inflow_m3h.size
    return Forcing(
        inflow_m3h=inflow_m3h,
        speed_factor=np.ones((pumps, seconds)),
        friction_factor=np.ones(seconds),
        static_rise_m=np.zeros(seconds),
    )


def empty_record(pumps: int, seconds: int) -> Record:
    """Record for the kernel to fill."""
    station = [np.empty(seconds) for _ in range(3)]
    each = [np.empty((pumps, seconds)) for _ in range(6)]
    return Record(station[0], station[1], each[0], each[1], each[2], each[3], station[2], each[4], each[5])
