"""A true station of the elastic plant as numbers in SI units, as its file says: pipes, pumps, machines, wet well."""

import math
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.truth.elastic.pipe import GRAVITY, TICK_S, Pipe, pipe_of

HOUR_S = 3600.0
WEIGHT_N_M3 = 9810.0
STANDING_SHARE = 0.02
"""Loss without load of a station file's load model, as a share of the rated shaft power. [1]"""
PRISMATIC, FILLET, WEDGE = 0.0, 1.0, 2.0
EARLY, SMOOTH = 1.0, 2.0
"""Forms of a ramp: fast at first, then slow; a smooth step."""


class Machinery(NamedTuple):
    """What is not told by a station file, and each station has its own of.

    Attributes
    ----------
    velocity_m_s, wave_m_s, length_m, roughness_mm : float
        Of the mains, at the duty of the first pump.
    inertia_s : float
        Kinetic energy at rated speed, twice, over the rated power. [s]
    rated_slip, breakdown_torque : float
        Of the motors, over synchronous speed and rated torque. [1, 1]
    copper, iron, standing : float
        Losses over the rated shaft power. [1]
    scan_s, scan_offset_s : float
        Cycle of the PLC and its first scan. [s, s]
    meter_s : float
        Damping of the flow meters. [s]
    """

    velocity_m_s: float = 1.5
    wave_m_s: float = 700.0
    length_m: float = 60.0
    roughness_mm: float = 0.25
    inertia_s: float = 0.2
    rated_slip: float = 0.012
    breakdown_torque: float = 2.4
    copper: float = 0.03
    iron: float = 0.02
    standing: float = 0.01
    scan_s: float = 0.5
    scan_offset_s: float = 0.0
    meter_s: float = 0.2


class ElasticSpec(NamedTuple):
    """A station as it truly is, in m, m³/s, s, W; arrays are one value a pump or a main. Defaults deviate in nothing.

    Attributes
    ----------
    shutoff_m, linear, square, rated_flow, rated_head_m, rated_w : (pumps,) arrays
        Head = shutoff N² + linear N q + square q² (both not positive); duty and electrical power of each alone.
    main_of, reaches : (pumps,) and (mains,) integer arrays
        Main of each pump; reaches into which a main is cut.
    lift_m, impedance, loss, darcy_share, reynolds, rough : float and (mains,) arrays
        Static lift; a / (g A); loss over q² at the duty; share of it that is friction of the wall, the Reynolds
        number per flow and the relative roughness. [m, s/m², s²/m⁵, 1, s/m³, 1]
    branch_loss, branch_inertance : float
        Of each pump's own pipe up to the main. [s²/m⁵, s²/m²]
    vane_loss, ring_leak, rag_limit_m, rag_s : (pumps,) arrays
        Worn vanes: head lost at the duty, over the rated; worn ring: inner flow K sqrt(H). Rags: head lost in the
        throttle that they make at the rated flow, and the time of running in which they are all there.
        [1, m^2.5/s, m, s]
    valve_leak, valve_barrier_m, valve_s : float and (pumps,) array
        Back flow K sqrt(H) of a shut valve; head over the main's that first opens it; time in which it falls shut
        against water that flows back. [m^2.5/s, m, s]
    lift_slope, lift_reference_m : float
        Fall of the lift per metre of level, and the level of the file's lift. [1, m]
    air_limit_m, air_growth_s, air_clearing_m3 : float
        Head of a full pocket, time in which it fills up while nothing flows, water that carries it out. [m, s, m³]
    area_m2, floor, floor_share, floor_height_m, crest_m : float
        Wet well: straight, with a rounded or wedged floor; its area at the bottom as a share, up to a height.
    seepage, seepage_swing : float
        Inflow without a meter, and how far it swings in a day. [m³/s, 1]
    compensation : float
        Speed at which the file tells the curve, over the synchronous one. [1]
    slip, breakdown, breakdown_slip, inertia_s, copper, iron, standing : float
        Of the machine. [1, 1, 1, s, 1, 1, 1]
    hunting, hunting_s : float
        Swing of the frequency that a drive gives. [1, s]
    ramp_form, ramp_bend, ramp_s : float
        What the drive makes of the ramp that it tells.
    shutoff_share, power_scale : float
        Shaft power at no flow over the rated; electrical power over that which the losses add up to. [1, 1]
    start_m, stop_m : (levels,) arrays
    scan_steps, scan_first, poll_s, old_s : float
        Cycle of the PLC in steps, its first scan; its level register is renewed so often by a value so old.
        [1, 1, s, s]
    level_filter_s, flow_filter_s, flow_cutoff : float
        Two filters in a row, of so much time together; flow under which the meter's converter gives none.
        [s, s, m³/s]
    suction_m, suction_level_m : float
        Head lost to cavitation at a level of 0, and the level from which there is none. [m, m]
    """

    shutoff_m: Floats
    linear: Floats
    square: Floats
    rated_flow: Floats
    rated_head_m: Floats
    rated_w: Floats
    main_of: Integers
    reaches: Integers
    lift_m: float
    impedance: Floats
    loss: Floats
    darcy_share: float
    reynolds: float
    rough: float
    branch_loss: float
    branch_inertance: float
    vane_loss: Floats
    ring_leak: Floats
    rag_limit_m: Floats
    rag_s: Floats
    valve_barrier_m: Floats
    area_m2: float
    crest_m: float
    slip: float
    breakdown: float
    breakdown_slip: float
    inertia_s: float
    copper: float
    iron: float
    standing: float
    compensation: float
    shutoff_share: float
    power_scale: float
    ramp_s: float
    start_m: Floats
    stop_m: Floats
    scan_steps: int
    scan_first: int
    flow_filter_s: float
    valve_leak: float = 0.0
    valve_s: float = 0.0
    lift_slope: float = 0.0
    lift_reference_m: float = 0.0
    air_limit_m: float = 0.0
    air_growth_s: float = 1.0
    air_clearing_m3: float = 1.0
    floor: float = PRISMATIC
    floor_share: float = 1.0
    floor_height_m: float = 1.0
    seepage: float = 0.0
    seepage_swing: float = 0.0
    hunting: float = 0.0
    hunting_s: float = 1.0
    ramp_form: float = 0.0
    ramp_bend: float = 0.0
    poll_s: float = 0.0
    old_s: float = 0.0
    level_filter_s: float = 0.0
    flow_cutoff: float = 0.0
    suction_m: float = 0.0
    suction_level_m: float = 1.0


def spec_of(station: Station, machinery: Machinery) -> ElasticSpec:
    """True station that is just as its file says, but for what a file does not tell.

    Raises
    ------
    ValueError
        If the file asks for what this plant does not have.
    """
    control, electrical, main = station.control, station.electrical, station.mains[0]
    plain = control.mode == "on_off" and control.rotation == "round_robin" and not control.out_of_service
    if not plain or control.min_frequency_hz > 0 or control.dwell_s > 0 or control.max_starts_per_hour > 0:
        raise ValueError(f"station '{station.name}': the elastic plant knows plain on/off control in rotation only")
    if len(station.mains) > 1 or main.delivery_level_m is not None or station.sump.area_m2 is None:
        raise ValueError(f"station '{station.name}': the elastic plant takes one main with a static head, one area")
    if station.effect or station.sump.profile is not None:
        raise ValueError(f"station '{station.name}': the elastic plant takes no effect and no profile")
    curves = np.array([pump.coefficients for pump in station.pump])
    pumps = len(curves)
    flows, heads_m = np.array([duty(station, i) for i in range(pumps)]).T
    loss = main.friction_h2_m5 * HOUR_S**2
    pipe = pipe_of(
        float(flows[0]),
        loss,
        velocity_m_s=machinery.velocity_m_s,
        wave_m_s=machinery.wave_m_s,
        column_s2_m2=machinery.length_m * machinery.velocity_m_s / (GRAVITY * float(flows[0])),
        roughness_mm=machinery.roughness_mm,
    )
    mains = 1 if main.layout == "common" else pumps
    breakdown_slip = _breakdown_slip(machinery.rated_slip, machinery.breakdown_torque)
    losses = 1.0 + machinery.rated_slip + machinery.copper + machinery.iron + machinery.standing
    return ElasticSpec(
        shutoff_m=curves[:, 0].copy(),
        linear=curves[:, 1] * HOUR_S,
        square=curves[:, 2] * HOUR_S**2,
        rated_flow=flows,
        rated_head_m=heads_m,
        rated_w=np.array([rated_power_w(station, i) for i in range(pumps)]),
        main_of=np.zeros(pumps, dtype=np.int64) if mains == 1 else np.arange(pumps),
        reaches=np.full(mains, pipe.reaches),
        lift_m=main.lift_at_zero_m,
        impedance=np.full(mains, pipe.impedance),
        loss=np.full(mains, loss),
        darcy_share=pipe.darcy_share,
        reynolds=pipe.reynolds,
        rough=pipe.rough,
        branch_loss=0.0,
        branch_inertance=BRANCH_INERTANCE,
        vane_loss=np.zeros(pumps),
        ring_leak=np.zeros(pumps),
        rag_limit_m=np.zeros(pumps),
        rag_s=np.ones(pumps),
        valve_barrier_m=np.zeros(pumps),
        area_m2=station.sump.area_m2,
        crest_m=control.start_levels_m[-1] + 3.0,
        slip=machinery.rated_slip,
        breakdown=machinery.breakdown_torque,
        breakdown_slip=breakdown_slip,
        inertia_s=machinery.inertia_s,
        copper=machinery.copper,
        iron=machinery.iron,
        standing=machinery.standing,
        compensation=1.0 - machinery.rated_slip,
        shutoff_share=electrical.shutoff_power_share,
        power_scale=1.0 / losses,
        ramp_s=control.ramp_s,
        start_m=np.array(control.start_levels_m),
        stop_m=np.array(control.stop_levels_m),
        scan_steps=max(round(machinery.scan_s / TICK_S), 1),
        scan_first=round(machinery.scan_offset_s / TICK_S),
        flow_filter_s=machinery.meter_s,
    )


BRANCH_INERTANCE = 10.0
"""Of the few metres from a pump to its main. [s²/m²]"""


def with_pipe(spec: ElasticSpec, pipe: Pipe) -> ElasticSpec:
    """The same station with another pipe for each of its mains."""
    mains = spec.reaches.size
    return spec._replace(
        reaches=np.full(mains, pipe.reaches),
        impedance=np.full(mains, pipe.impedance),
        darcy_share=pipe.darcy_share,
        reynolds=pipe.reynolds,
        rough=pipe.rough,
    )


def with_slip(spec: ElasticSpec, rated_slip: float) -> ElasticSpec:
    """The same station with motors of another slip, whose curve the file tells at synchronous speed."""
    return spec._replace(
        slip=rated_slip, compensation=1.0, breakdown_slip=_breakdown_slip(rated_slip, spec.breakdown)
    )


def _breakdown_slip(rated_slip: float, breakdown: float) -> float:
    r"""Slip of the greatest torque after Kloss: $s_b = s_n (m + \sqrt{m^2 - 1})$. [1]."""
    return rated_slip * (breakdown + math.sqrt(breakdown**2 - 1.0))


def duty(station: Station, pump: int) -> tuple[float, float]:
    r"""Flow and head of a pump alone at nominal speed. [m³/s, m].

    The root of $c_0 - H_s + c_1 Q + (c_2 - k) Q^2$.
    """
    c0, c1, c2 = station.pump[pump].coefficients
    main = station.mains[0]
    roots = np.roots([c2 - main.friction_h2_m5, c1, c0 - main.lift_at_zero_m])
    flow_m3h = float(max(roots.real))
    return flow_m3h / HOUR_S, c0 + (c1 + c2 * flow_m3h) * flow_m3h


def rated_power_w(station: Station, pump: int) -> float:
    """Electrical power of a pump at its duty, as the load model of the file tells it. [W]."""
    electrical = station.electrical
    flow, head_m = duty(station, pump)
    shaft_w = WEIGHT_N_M3 * flow * head_m / electrical.efficiency
    return shaft_w / (electrical.motor_efficiency * electrical.drive_efficiency)
