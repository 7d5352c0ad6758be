"""Parameters of a plant by name: the hook of effects, and what the kernel reads."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import plain
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, HEAD, INFLOW, LEVEL, POWER, AnalogueQuantity
from wetwell.protocols.station.pump import Pump
from wetwell.protocols.station.rising_main import RisingMain
from wetwell.protocols.station.station_file import Electrical, Sensors, Station
from wetwell.simulator.corrections.parts import Column, CorrectionPart
from wetwell.simulator.hydraulics import pump_head_m
from wetwell.simulator.power import STANDING_LOSS_SHARE, hydraulic_power_kw, power_line, shaft_points
from wetwell.simulator.records import Records, records_of
from wetwell.simulator.telemetry.channels import PUMP_CHANNELS, channels, channels_of
from wetwell.simulator.wet_well import SECONDS_PER_HOUR, ProfileSlice, profile_of_slices

_NO_CORRECTION = (CorrectionPart(term=0, size=0.0),)
"""Records have at least one: compiled code must know what they are."""

ROUND_ROBIN, FIXED, LEAST_RUN_TIME = range(3)
ROTATIONS = ("round_robin", "fixed", "least_run_time")
SMALLEST_HEAD_M = 1e-6
"""Rated head at the least, so that a main without friction and lift has a rated power to compare with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PumpParameters:
    """A pump: its main, its curve and rated duty, and what is not as new.

    Its shaft power is a line over the flow, from `shutoff_power_share` of the rated one at no flow. Rags gather in a
    run at the rated flow with time constant `ragging_s`: all of them cost `ragging_speed_loss` of the speed, and
    `ragging_h2_m5` Q² of head. `slip` is the loss of speed at rated torque, and `slip_power_exponent` the power of
    that speed with which the electrical power falls. While the pump stands, `valve_leak_m3h` flows back through its
    check valve at 1 m of head. What first opens that valve is `valve_opening_m` over the head behind it.
    """

    c0: float
    c1: float
    c2: float
    nominal_frequency_hz: float
    main: int
    rated_flow_m3h: float
    rated_shaft_kw: float
    shutoff_power_share: float
    ragging_speed_loss: float = 0.0
    ragging_h2_m5: float = 0.0
    ragging_s: float = math.inf
    slip: float = 0.0
    slip_power_exponent: float = 0.0
    valve_leak_m3h: float = 0.0
    valve_opening_m: float = 0.0
    is_automatic: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class MainParameters:
    """A rising main.

    Its static head is that at level 0 of the wet well and falls by `level_slope` for each metre of level, and by
    `lift_slope` for each metre above `lift_reference_m`. It loses k Q (Q + s) with s = `linear_flow_m3h`: 0 where it
    is rough. On a common header, the share `shared_friction` of k acts on the total flow, the rest on that of each
    pump. `inertia_s2_m2` = length / (g area); a wave takes `wave_s` there and back, 0 where the water is rigid. Air
    grows idle and purges running: in a common header for all pumps, else for each by itself or, where
    `is_air_shared`, at one high point.
    """

    static_head_m: float
    level_slope: float
    friction_h2_m5: float
    linear_flow_m3h: float = 0.0
    is_common_header: bool
    shared_friction: float = 1.0
    lift_slope: float = 0.0
    lift_reference_m: float = 0.0
    inertia_s2_m2: float = 0.0
    wave_s: float = 0.0
    air_head_m: float = 0.0
    air_growth_s: float = math.inf
    air_purge_s: float = math.inf
    is_air_shared: bool = False

    def static_head_at_m(self, level_m: float) -> float:
        """Static head with the wet well at a level, without air; never negative. [m]."""
        return float(self.static_heads_m(np.array([level_m]))[0])

    def static_heads_m(self, level_m: Floats) -> Floats:
        """The same at levels; NaN where it goes by a level that is NaN. [m]."""
        if self.level_slope == 0.0 == self.lift_slope:
            return np.full(level_m.shape, max(self.static_head_m, 0.0))
        falling_m = self.level_slope * level_m + self.lift_slope * (level_m - self.lift_reference_m)
        return np.maximum(self.static_head_m - falling_m, 0.0)

    @property
    def own_h2_m5(self) -> float:
        """Friction of what each pump has for itself of a common header; 0 where it has a whole main. [h²/m⁵]."""
        return self.friction_h2_m5 * (1.0 - self.shared_friction) if self.is_common_header else 0.0

    def friction_m(self, flow_m3h: Floats) -> Floats:
        """Head that the whole main loses to friction at total flows. [m]."""
        return self.friction_h2_m5 * flow_m3h * (flow_m3h + self.linear_flow_m3h)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorParameters:
    r"""How a channel measures and transmits.

    The sensor: $y = g\, x_\tau + o$ with x damped by one or two first-order lags in a row, of which `followed` and
    `followed_again` are the shares of a step that they follow within a second, `carried` what the first still brings
    to the second of where it was before, and `late` and `late_again` the shares of the value of a second before,
    since it moves evenly from second to second; then noise $y (1 + \sigma n)$ (the level: $y + \sigma n$) with $n$
    white or AR(1), then 0 below a cutoff. The telemetry: a delay, rounding to a quantum, and a value that is held
    until it has moved by a deadband.
    """

    gain: float = 1.0
    offset: float = 0.0
    followed: float = 1.0
    followed_again: float = 1.0
    carried: float = 0.0
    late: float = 0.0
    late_again: float = 0.0
    noise: float = 0.0
    correlation: float
    cutoff: float = -math.inf
    delay_s: float = 0.0
    quantum: float = 0.0
    deadband: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantParameters:
    """A station as the kernel reads it.

    Wet well: profile, an overflow weir, inflow that no meter sees, as its mean and its swing over the day. Pumps: see
    `PumpParameters`. Mains: see `MainParameters`. Drive: shape of the ramp. Control: levels, delay, rotation, limits,
    level controller. `rated_level_m` is where the rated duties are told. Electrical: a power that follows the
    frequency, or the load, or between the two by `load_share`; of the load `losses_share` of the rated power is lost
    whatever it is. Sensors: one a channel. Corrections: learnt addends to
    terms, and the columns of a user that they go by, in the order of the forcing's.
    """

    profile: Records[ProfileSlice]
    overflow_level_m: float
    weir_width_m: float
    unmetered_inflow_m3h: float = 0.0
    unmetered_cosine_m3h: float = 0.0
    unmetered_sine_m3h: float = 0.0

    pumps: tuple[PumpParameters, ...]

    mains: tuple[MainParameters, ...]
    rated_level_m: float

    ramp_s: float
    min_frequency_hz: float
    dwell_s: float
    ramp_power: float = 1.0
    ramp_bow: float = 0.0
    ramp_ahead: float = 0.0
    ramp_knee: float = 0.25
    speed_lag_s: float = 0.0

    start_levels_m: Floats
    stop_levels_m: Floats
    control_delay_s: float = 0.0
    rotation: int
    starts_per_hour: int
    is_pid: bool
    pid_level_m: float
    pid_gain_hz_m: float
    pid_integral_s: float
    pid_derivative_s: float

    voltage_v: float
    rated_current_a: float
    power_factor: float
    motor_efficiency: float
    drive_efficiency: float
    load_share: float
    losses_share: float = STANDING_LOSS_SHARE

    sensors: tuple[SensorParameters, ...]

    corrections: tuple[CorrectionPart, ...] = ()
    columns: tuple[Column, ...] = ()

    @property
    def curves(self) -> Floats:
        """(pumps, 3) coefficients of the pump curves at nominal speed. [m, m/(m³/h), m/(m³/h)²]."""
        return np.array([(pump.c0, pump.c1, pump.c2) for pump in self.pumps])

    @property
    def nominal_frequency_hz(self) -> Floats:
        """(pumps,) nominal frequencies. [Hz]."""
        return np.array([pump.nominal_frequency_hz for pump in self.pumps])

    @property
    def rated_flow_m3h(self) -> Floats:
        """(pumps,) flows of each pump alone at nominal speed. [m³/h]."""
        return np.array([pump.rated_flow_m3h for pump in self.pumps])

    @property
    def rated_head_m(self) -> Floats:
        """(pumps,) heads at these flows. [m]."""
        return np.array([pump_head_m(pump.c0, pump.c1, pump.c2, 1.0, pump.rated_flow_m3h) for pump in self.pumps])

    @property
    def rated_inertia_s2_m2(self) -> Floats:
        """(pumps,) inertias of the water that these heads bring to these flows in a second. [s²/m²]."""
        return np.asarray(SECONDS_PER_HOUR * self.rated_head_m / self.rated_flow_m3h, dtype=np.float64)

    def with_pumps(self, changed: Callable[[PumpParameters], PumpParameters], number: int = 0) -> "PlantParameters":
        """The same plant with one pump changed (from 1), or all (0)."""
        pumps = [changed(pump) if number in {0, i} else pump for i, pump in enumerate(self.pumps, start=1)]
        return replace(self, pumps=tuple(pumps))

    def with_mains(self, changed: Callable[[MainParameters], MainParameters], number: int = 0) -> "PlantParameters":
        """The same plant with one main changed (from 1), or all (0)."""
        mains = [changed(main) if number in {0, m} else main for m, main in enumerate(self.mains, start=1)]
        return replace(self, mains=tuple(mains))

    def main_of(self, pump: int) -> MainParameters:
        """Main of a pump, counted from 0."""
        return self.mains[self.pumps[pump].main]

    def with_sensors(
        self, changed: Callable[[SensorParameters], SensorParameters], quantity: AnalogueQuantity
    ) -> "PlantParameters":
        """The same plant with the sensors of a quantity changed, those of all pumps."""
        rows = channels_of(quantity, len(self.pumps))
        sensors = [changed(sensor) if row in rows else sensor for row, sensor in enumerate(self.sensors)]
        return replace(self, sensors=tuple(sensors))

    def records(self) -> "PlantRecords":
        """What compiled code reads, of its own: it may be changed."""
        mains = np.array([pump.main for pump in self.pumps])
        return PlantRecords(
            station=records_of([self]),
            mains=records_of(self.mains),
            pumps=records_of(self.pumps),
            pumps_by_main=np.argsort(mains, kind="stable"),
            has_air=any(main.air_head_m > 0.0 for main in self.mains),
            pumps_until=np.cumsum([0, *np.bincount(mains, minlength=len(self.mains))]),
            sensors=records_of(self.sensors),
            corrections=records_of(self.corrections or _NO_CORRECTION),
            has_corrections=bool(self.corrections),
            profile=self.profile,
            start_levels_m=self.start_levels_m.copy(),
            stop_levels_m=self.stop_levels_m.copy(),
        )


class PlantRecords(NamedTuple):
    """Parameters of a plant in records; of the station there is one.

    Main m has the pumps `pumps_by_main[pumps_until[m]:pumps_until[m + 1]]`, counted from 0. `has_air` says whether
    air may gather in any, `has_corrections` whether a correction acts.
    """

    station: Records[PlantParameters]
    mains: Records[MainParameters]
    pumps: Records[PumpParameters]
    pumps_by_main: Integers
    pumps_until: Integers
    has_air: bool
    sensors: Records[SensorParameters]
    corrections: Records[CorrectionPart]
    has_corrections: bool
    profile: Records[ProfileSlice]
    start_levels_m: Floats
    stop_levels_m: Floats


def plant_parameters(station: Station) -> PlantParameters:
    """Parameters of a station without its effects."""
    control, electrical = station.control, station.electrical
    return PlantParameters(
        profile=profile_of_slices(station.sump.slices),
        overflow_level_m=math.inf if station.sump.overflow_level_m is None else station.sump.overflow_level_m,
        weir_width_m=station.sump.weir_width_m,
        pumps=_pump_parameters(station),
        mains=tuple(_main_parameters(main) for main in station.mains),
        rated_level_m=station.middle_level_m,
        ramp_s=control.ramp_s,
        min_frequency_hz=control.min_frequency_hz,
        dwell_s=control.dwell_s,
        start_levels_m=np.array(control.start_levels_m),
        stop_levels_m=np.array(control.stop_levels_m),
        rotation=ROTATIONS.index(control.rotation),
        starts_per_hour=control.max_starts_per_hour,
        is_pid=control.mode == "pid",
        pid_level_m=control.setpoint_m,
        pid_gain_hz_m=control.gain_hz_m,
        pid_integral_s=control.integral_s,
        pid_derivative_s=control.derivative_s,
        voltage_v=electrical.voltage_v,
        rated_current_a=electrical.rated_current_a,
        power_factor=electrical.power_factor,
        motor_efficiency=electrical.motor_efficiency,
        drive_efficiency=electrical.drive_efficiency,
        load_share=1.0 if electrical.power_model == "load" else 0.0,
        sensors=_sensor_parameters(station.sensors, len(station.pump)),
    )


def _main_parameters(main: RisingMain) -> MainParameters:
    return MainParameters(
        static_head_m=main.lift_at_zero_m,
        level_slope=main.level_slope,
        friction_h2_m5=main.friction_h2_m5,
        is_common_header=main.layout == "common",
    )


def _pump_parameters(station: Station) -> tuple[PumpParameters, ...]:
    """Pumps with their rated duty: each alone at nominal speed, with the wet well at its middle level."""
    mains = [station.mains[main] for main in station.main_of_pump]
    static_head_m = np.array([main.static_head_at_m(station.middle_level_m) for main in mains])
    friction_h2_m5 = np.array([main.friction_h2_m5 for main in mains])
    c0, c1, c2 = np.array([pump.coefficients for pump in station.pump]).T
    lift_m = c0 - static_head_m
    flow_m3h = 2.0 * lift_m / (-c1 + np.sqrt(c1**2 + 4.0 * (friction_h2_m5 - c2) * lift_m))
    head_m = np.maximum(c0 + c1 * flow_m3h + c2 * flow_m3h**2, SMALLEST_HEAD_M)
    parameters: list[PumpParameters] = []
    for i, (rated_m3h, rated_m) in enumerate(zip(flow_m3h.tolist(), head_m.tolist(), strict=True)):
        pump = station.pump[i]
        shaft_kw, shutoff_share = _rated_power(pump, station.electrical, rated_m3h, rated_m)
        parameters.append(
            PumpParameters(
                c0=pump.coefficients[0],
                c1=pump.coefficients[1],
                c2=pump.coefficients[2],
                nominal_frequency_hz=pump.nominal_frequency_hz,
                main=station.main_of_pump[i],
                rated_flow_m3h=rated_m3h,
                rated_shaft_kw=shaft_kw,
                shutoff_power_share=shutoff_share,
                is_automatic=i + 1 not in station.control.out_of_service,
            )
        )
    return tuple(parameters)


def _rated_power(pump: Pump, electrical: Electrical, rated_m3h: float, rated_m: float) -> tuple[float, float]:
    """Shaft power of a pump at its rated duty, and the share of it at no flow: its own, or that of the station."""
    points = shaft_points(pump.coefficients, pump.power_points, pump.efficiency_points)
    share = electrical.shutoff_power_share
    if not points:
        return plain(hydraulic_power_kw)(rated_m3h, rated_m) / electrical.efficiency, share
    shutoff_kw, slope_kwh_m3 = power_line(points, share, rated_m3h)
    rated_kw = shutoff_kw + slope_kwh_m3 * rated_m3h
    return rated_kw, shutoff_kw / rated_kw


def _sensor_parameters(sensors: Sensors, pumps: int) -> tuple[SensorParameters, ...]:
    noise = np.zeros(channels(pumps))
    noise[LEVEL] = sensors.level_noise_m
    noise[INFLOW] = sensors.inflow_noise
    noise[FIRST_PUMP + FLOW :: PUMP_CHANNELS] = sensors.flow_noise
    noise[FIRST_PUMP + HEAD :: PUMP_CHANNELS] = sensors.head_noise
    noise[FIRST_PUMP + POWER :: PUMP_CHANNELS] = sensors.power_noise
    return tuple(SensorParameters(noise=share, correlation=sensors.correlation) for share in noise.tolist())
