"""A plant: its named parameters, what acts on it, and the plain arrays that the kernel works on.

The fields of `PlantParameters` and `Forcing` are the hooks of effects and faults: an effect replaces parameters or
works into the forcing, a fault works into the forcing, and the kernel knows neither by name.
"""

from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.station_file import Station
from wetwell.simulator import layout as at
from wetwell.simulator.control import ROTATIONS
from wetwell.simulator.kernel import advance
from wetwell.simulator.power import hydraulic_power_kw
from wetwell.simulator.telemetry.channels import channels
from wetwell.simulator.telemetry.sensors import MAX_DELAY_S, SensorParameters, followed_share, sensor_parameters
from wetwell.simulator.wet_well import level_at_volume_m, profile_of, volume_at_level_m3

MAX_STARTS_PER_HOUR = 60
SMALLEST_HEAD_M = 1e-6
"""Rated head at the least, so that a main without friction and lift has a rated power to compare with."""
PAST_S = MAX_DELAY_S + 2


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantParameters:
    """A station as the kernel reads it; arrays are one value a pump where nothing else is said.

    Wet well: profile (see `wet_well.profile_of`), an overflow weir, inflow that no meter sees. Pumps: curves;
    loss of speed by ragging, which grows in a run towards `ragging_limit` with time constant `ragging_s`; slip,
    the loss of speed at rated torque; back flow through the check valve of a standing pump at 1 m. Rising main:
    on a common header, the share `shared_friction` of k acts on the total flow, the rest on each pump's own;
    static head that falls by `lift_slope` for each metre of level above `lift_reference_m`; `inertia_s2_m2` =
    length / (g area); air that grows idle and purges running, in each main. Drive: shape of the ramp. Control:
    levels, delay, rotation, limits, level controller. Electrical: a power that follows the frequency, or the load,
    or between the two by `load_share`.
    """

    profile: Floats
    overflow_level_m: float
    weir_width_m: float
    unmetered_inflow_m3h: float

    curves: Floats
    nominal_frequency_hz: Floats
    rated_hydraulic_kw: Floats
    rated_flow_m3h: Floats
    ragging_limit: Floats
    ragging_s: Floats
    slip: Floats
    valve_leak_m3h: Floats

    static_head_m: float
    friction_h2_m5: float
    is_common_header: bool
    shared_friction: float
    lift_slope: float
    lift_reference_m: float
    inertia_s2_m2: float
    air_head_m: float
    air_growth_s: float
    air_purge_s: float
    is_air_shared: bool

    ramp_s: float
    min_frequency_hz: float
    dwell_s: float
    ramp_power: float
    ramp_bow: float
    speed_lag_s: float

    start_levels_m: Floats
    stop_levels_m: Floats
    is_automatic: Floats
    control_delay_s: float
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
    pump_efficiency: float
    motor_efficiency: float
    drive_efficiency: float
    shutoff_power_share: float
    load_share: float

    sensors: SensorParameters

    def with_sensors(self, sensors: SensorParameters) -> "PlantParameters":
        """The same plant with other sensors."""
        return replace(self, sensors=sensors)


@dataclass(frozen=True, slots=True, kw_only=True)
class Forcing:
    """What acts on the plant in a block of n seconds: views of the kernel's `arrays`, to be worked into in place.

    Inflow, friction, static head and voltage are (n,); factors and leaks of the pumps are (pumps, n). Factors are 1,
    rises and leaks 0 in health. `is_plc_frozen` stops the PLC's program: outputs and telemetry stay as they are. The
    sensor arrays are (channels, n), or (channels, 1) where no sensor is at fault: a bias in units of the channel, a
    factor on its noise, and whether it is stuck (1) or not (0). Where one is at fault, `arrays` has at least two
    columns for them, which tells the kernel so.
    """

    inflow_m3h: Floats
    speed_factor: Floats
    head_factor: Floats
    internal_leak_m3h: Floats
    valve_leak_m3h: Floats
    is_tripped: Floats
    friction_factor: Floats
    static_rise_m: Floats
    voltage_factor: Floats
    is_plc_frozen: Floats
    sensor_bias: Floats
    sensor_noise_factor: Floats
    is_sensor_stuck: Floats
    arrays: tuple[Floats, Floats, Floats]


def plant_parameters(station: Station) -> PlantParameters:
    """Parameters of a station without its effects."""
    pumps = len(station.pump)
    control, electrical, main = station.control, station.electrical, station.rising_main
    curves = np.array([pump.coefficients for pump in station.pump])
    flow_m3h, head_m = _rated_duty(curves, main.static_head_m, main.friction_h2_m5)
    is_automatic = np.ones(pumps)
    is_automatic[[pump - 1 for pump in control.out_of_service]] = 0.0
    return PlantParameters(
        profile=profile_of(station.sump.profile or [(0.0, station.sump.area_m2)]),
        overflow_level_m=np.inf if station.sump.overflow_level_m is None else station.sump.overflow_level_m,
        weir_width_m=station.sump.weir_width_m,
        unmetered_inflow_m3h=0.0,
        curves=curves,
        nominal_frequency_hz=np.array([pump.nominal_frequency_hz for pump in station.pump]),
        rated_hydraulic_kw=np.array([hydraulic_power_kw(*duty) for duty in zip(flow_m3h, head_m, strict=True)]),
        rated_flow_m3h=flow_m3h,
        ragging_limit=np.zeros(pumps),
        ragging_s=np.full(pumps, np.inf),
        slip=np.zeros(pumps),
        valve_leak_m3h=np.zeros(pumps),
        static_head_m=main.static_head_m,
        friction_h2_m5=main.friction_h2_m5,
        is_common_header=main.layout == "common",
        shared_friction=1.0,
        lift_slope=0.0,
        lift_reference_m=0.0,
        inertia_s2_m2=0.0,
        air_head_m=0.0,
        air_growth_s=np.inf,
        air_purge_s=np.inf,
        is_air_shared=False,
        ramp_s=control.ramp_s,
        min_frequency_hz=control.min_frequency_hz,
        dwell_s=control.dwell_s,
        ramp_power=1.0,
        ramp_bow=0.0,
        speed_lag_s=0.0,
        start_levels_m=np.array(control.start_levels_m),
        stop_levels_m=np.array(control.stop_levels_m),
        is_automatic=is_automatic,
        control_delay_s=0.0,
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
        pump_efficiency=electrical.efficiency,
        motor_efficiency=electrical.motor_efficiency,
        drive_efficiency=electrical.drive_efficiency,
        shutoff_power_share=electrical.shutoff_power_share,
        load_share=1.0 if electrical.power_model == "load" else 0.0,
        sensors=sensor_parameters(station.sensors, pumps),
    )


def _rated_duty(curves: Floats, static_head_m: float, friction_h2_m5: float) -> tuple[Floats, Floats]:
    """Flow and head of each pump alone at nominal speed. [m³/h, m]."""
    c0, c1, c2 = curves.T
    lift_m = c0 - static_head_m
    flow_m3h = 2.0 * lift_m / (-c1 + np.sqrt(c1**2 + 4.0 * (friction_h2_m5 - c2) * lift_m))
    return flow_m3h, np.maximum(c0 + c1 * flow_m3h + c2 * flow_m3h**2, SMALLEST_HEAD_M)


def healthy_forcing(inflow_m3h: Floats, pumps: int, *, with_sensors: bool = False) -> Forcing:
    """Forcing without any fault, with or without room for faults of the sensors."""
    seconds = inflow_m3h.size
    station = np.ones((at.STATION_FORCES, seconds))
    station[at.INFLOW_FORCE] = inflow_m3h
    station[[at.STATIC_RISE, at.IS_PLC_FROZEN]] = 0.0
    pump = np.ones((at.PUMP_FORCES, pumps, seconds))
    pump[[at.INTERNAL_LEAK, at.VALVE_LEAK_FORCE, at.IS_TRIPPED]] = 0.0
    sensor = np.zeros((at.SENSOR_FORCES, channels(pumps), max(seconds, 2) if with_sensors else 1))
    sensor[at.NOISE_FACTOR] = 1.0
    acting = slice(seconds if with_sensors else 1)
    return Forcing(
        inflow_m3h=station[at.INFLOW_FORCE],
        speed_factor=pump[at.SPEED_FACTOR],
        head_factor=pump[at.HEAD_FACTOR],
        internal_leak_m3h=pump[at.INTERNAL_LEAK],
        valve_leak_m3h=pump[at.VALVE_LEAK_FORCE],
        is_tripped=pump[at.IS_TRIPPED],
        friction_factor=station[at.FRICTION_FACTOR],
        static_rise_m=station[at.STATIC_RISE],
        voltage_factor=station[at.VOLTAGE_FACTOR],
        is_plc_frozen=station[at.IS_PLC_FROZEN],
        sensor_bias=sensor[at.SENSOR_BIAS, :, acting],
        sensor_noise_factor=sensor[at.NOISE_FACTOR, :, acting],
        is_sensor_stuck=sensor[at.IS_STUCK, :, acting],
        arrays=(station, pump, sensor),
    )


@dataclass(frozen=True, slots=True)
class Record:
    """What a block of n seconds brought: (channels, n) as measured; (2, n) and (3, pumps, n) as it truly was.

    Rows of the truths as in `layout`: level and overflow; flow, head and power.
    """

    measured: Floats
    station_truth: Floats
    pump_truth: Floats


class Plant:
    """A plant that runs: its arrays, changed in place by the kernel.

    Parameters
    ----------
    parameters : PlantParameters
    level_m : float
        Level at the beginning, with all pumps standing, for so long that all air has gathered. [m]
    """

    def __init__(self, parameters: PlantParameters, level_m: float) -> None:
        pumps = parameters.nominal_frequency_hz.size
        self._station, self._pump, self._sensor = pack(parameters)
        self._profile = parameters.profile
        self.levels_m = np.array([parameters.start_levels_m, parameters.stop_levels_m])
        self.is_automatic = self._pump[at.IS_AUTOMATIC]
        self._station_state = np.zeros(at.STATION_STATES)
        self._station_state[at.VOLUME] = volume_at_level_m3(level_m, parameters.profile)
        self._station_state[at.WANTED_FREQUENCY] = np.inf
        self._pump_state = np.zeros((at.PUMP_STATES, pumps))
        self._pump_state[at.AIR] = parameters.air_head_m
        self._channel_state = np.full((at.CHANNEL_STATES, channels(pumps)), np.nan)
        self._channel_state[at.LAST_NOISE] = 0.0
        self._past = np.full((channels(pumps), PAST_S), np.nan)
        self._level_history = np.full(PAST_S, np.nan)
        self._started = np.zeros(pumps, dtype=np.int64)
        self._recent_starts = np.full((pumps, MAX_STARTS_PER_HOUR), -3600, dtype=np.int64)
        self._curves = np.zeros((pumps, 3))
        self._counters = np.zeros(at.COUNTERS, dtype=np.int64)

    @property
    def seconds(self) -> int:
        """Seconds since the beginning."""
        return int(self._counters[at.SECOND])

    @property
    def level_m(self) -> float:
        """True level; may be set. [m]."""
        return level_at_volume_m(self._station_state[at.VOLUME], self._profile)

    @level_m.setter
    def level_m(self, level_m: float) -> None:
        self._station_state[at.VOLUME] = volume_at_level_m3(level_m, self._profile)

    @property
    def commanded(self) -> list[int]:
        """Commanded pumps, from 1, in the order of their starts."""
        return [int(pump) + 1 for pump in self._started[: self._counters[at.RUNNING]]]

    def advance(self, forcing: Forcing, rng: np.random.Generator) -> Record:
        """Advance by as many seconds as the forcing has."""
        pumps, seconds = self._pump.shape[1], forcing.inflow_m3h.size
        record = Record(
            np.zeros((channels(pumps), seconds)),
            np.empty((at.STATION_TRUTHS, seconds)),
            np.zeros((at.PUMP_TRUTHS, pumps, seconds)),
        )
        advance(
            self._station,
            self._pump,
            self._profile,
            self.levels_m,
            self._sensor,
            self._station_state,
            self._pump_state,
            self._channel_state,
            self._past,
            self._level_history,
            self._started,
            self._recent_starts,
            self._counters,
            self._curves,
            *forcing.arrays,
            rng,
            record.measured,
            record.station_truth,
            record.pump_truth,
        )
        return record


def pack(parameters: PlantParameters) -> tuple[Floats, Floats, Floats]:
    """Vector of the station, (rows, pumps) and (rows, channels): the parameters in the rows of `layout`."""
    p = parameters
    station = np.array(
        [
            p.overflow_level_m,
            p.weir_width_m,
            p.unmetered_inflow_m3h,
            p.static_head_m,
            p.friction_h2_m5,
            p.is_common_header,
            p.shared_friction,
            p.lift_slope,
            p.lift_reference_m,
            p.inertia_s2_m2,
            p.air_head_m,
            p.air_growth_s,
            p.air_purge_s,
            p.is_air_shared,
            p.ramp_s,
            p.min_frequency_hz,
            p.dwell_s,
            p.ramp_power,
            p.ramp_bow,
            p.speed_lag_s,
            p.control_delay_s,
            p.rotation,
            p.starts_per_hour,
            p.is_pid,
            p.pid_level_m,
            p.pid_gain_hz_m,
            p.pid_integral_s,
            p.pid_derivative_s,
            p.voltage_v,
            p.rated_current_a,
            p.power_factor,
            p.pump_efficiency,
            p.motor_efficiency,
            p.drive_efficiency,
            p.shutoff_power_share,
            p.load_share,
        ],
        dtype=np.float64,
    )
    pump = np.array(
        [
            *p.curves.T,
            p.nominal_frequency_hz,
            p.rated_hydraulic_kw,
            p.rated_flow_m3h,
            p.ragging_limit,
            p.ragging_s,
            p.slip,
            p.valve_leak_m3h,
            p.is_automatic,
        ]
    )
    sensor = np.array(p.sensors)
    sensor[at.FOLLOWED] = [followed_share(lag_s) for lag_s in p.sensors.lag_s]
    return station, pump, sensor
