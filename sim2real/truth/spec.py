"""A true station as numbers in SI units, and what acts on it from outside."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.station_file import Station

HOUR_S = 3600.0
WATER_N_M3 = 1000.0 * 9.81
SMALL_INERTANCE = 20.0
"""Of a few metres of pipe: water settles in some hundredths of a second. [s²/m²]"""
PRISM, CONE, BENCH = range(3)


class Spec(NamedTuple):
    """A station as it truly is, SI units: m, m³/s, s, W; arrays are one value a pump. Defaults deviate in nothing.

    Attributes
    ----------
    shutoff_m, linear, square : (pumps,) arrays
        Pump head = shutoff N² − linear N q − square q². [m, s/m², s²/m⁵]
    head_factor, ring_leak : (pumps,) arrays
        Worn impeller: factor on the curve; worn ring: flow K sqrt(H) that runs back inside. [1, m^2.5/s]
    rag_limit, rag_half_m3 : (pumps,) arrays
        Loss of speed that a volume pumped since the start brings: limit V / (V + V_half). [1, m³]
    vortex_m, vortex_level_m : float
        Head lost at zero level, falling as a square to none at a level. [m, m]
    flap_leak, flap_opening_m : float and (pumps,) array
        Check valve: back flow K sqrt(H) when shut; head over the main's that first opens it. [m^2.5/s, m]
    lift_m, lift_slope, lift_reference_m : float
        Static lift at the reference level and its fall per metre of level. [m, 1, m]
    own_loss, shared_loss, smoothness, rated_flow : float
        Loss K q² of each pump's own pipe and of the shared one; a share of them goes by Blasius' law, like q^1.75,
        equal at the rated flow. [s²/m⁵, s²/m⁵, 1, m³/s]
    own_inertance, shared_inertance : float
        length / (g area). [s²/m²]
    air_limit_m, air_seed_m, air_rate, air_purge_m3 : float
        Air at a high point: logistic growth while nothing flows, carried out by pumped volume. [m, m, 1/s, m³]
    siphon_m, siphon_flow, siphon_prime_s : float
        Lift saved by a siphon that has run full for a time; it breaks under a flow. [m, m³/s, s]
    area_m2, shape, floor_factor, shape_height_m : float
        Wet well: prism, cone or bench; the area at the floor as a factor, up to a height. [m², -, 1, m]
    hidden_inflow, crest_m : float
        Inflow without a meter; level at which the wet well spills. [m³/s, m]
    slip, hunting, hunting_s : float
        Slip at rated torque; swing of the real speed and its period. [1, 1, s]
    ramp_bow, ramp_s : float
        Share of a half cosine in the ramp of the shaft (negative: of a parabola); time of the ramp. [1, s]
    rated_power_w, load_share, rated_factor : float
        Power meter: share that follows the load. [W, 1, 1]
    start_m, stop_m : (levels,) arrays
        As the PLC has them. [m]
    timer_s, level_lag_s, flow_lag_s : float
        On- and off-delay timer of the PLC; damping of the sensors. [s]
    """

    shutoff_m: Floats
    linear: Floats
    square: Floats
    head_factor: Floats
    ring_leak: Floats
    rag_limit: Floats
    rag_half_m3: Floats
    flap_opening_m: Floats
    lift_m: float
    own_loss: float
    shared_loss: float
    rated_flow: float
    area_m2: float
    crest_m: float
    ramp_s: float
    rated_power_w: float
    start_m: Floats
    stop_m: Floats
    vortex_m: float = 0.0
    vortex_level_m: float = 1.0
    flap_leak: float = 0.0
    lift_slope: float = 0.0
    lift_reference_m: float = 0.0
    smoothness: float = 0.0
    own_inertance: float = SMALL_INERTANCE
    shared_inertance: float = 0.0
    air_limit_m: float = 0.0
    air_seed_m: float = 0.0
    air_rate: float = 0.0
    air_purge_m3: float = 1.0
    siphon_m: float = 0.0
    siphon_flow: float = 0.0
    siphon_prime_s: float = 1.0
    shape: float = PRISM
    floor_factor: float = 1.0
    shape_height_m: float = 1.0
    hidden_inflow: float = 0.0
    slip: float = 0.0
    hunting: float = 0.0
    hunting_s: float = 1.0
    ramp_bow: float = 0.0
    load_share: float = 0.0
    rated_factor: float = 1.0
    timer_s: float = 0.0
    level_lag_s: float = 0.0
    flow_lag_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What acts from outside in each of n seconds; arrays are worked into in place.

    Attributes
    ----------
    inflow, metered_inflow : (n + 1,) arrays
        True inflow, linear between the seconds, and what passes its meter. [m³/s]
    loss_factor, extra_lift_m, voltage_factor : (n,) arrays
        On the losses of the main, on its lift, on the power. [1, m, 1]
    speed_factor : (pumps, n) array
        Speed that the water sees, over that of the shaft. [1]
    level_error_m, is_level_stuck : (n,) arrays
        Of the level sensor, seen by the PLC too: noise, bias; whether it repeats itself. [m, 0 or 1]
    """

    inflow: Floats
    metered_inflow: Floats
    loss_factor: Floats
    extra_lift_m: Floats
    voltage_factor: Floats
    speed_factor: Floats
    level_error_m: Floats
    is_level_stuck: Floats


def spec_of(station: Station) -> Spec:
    """True station that is just as its file says.

    Raises
    ------
    ValueError
        If the file asks for what this plant does not have.
    """
    control, electrical, main = station.control, station.electrical, station.mains[0]
    plain = control.mode == "on_off" and control.rotation == "round_robin" and not control.out_of_service
    if not plain or control.min_frequency_hz > 0 or control.dwell_s > 0 or control.max_starts_per_hour > 0:
        raise ValueError(f"station '{station.name}': the truth plant knows plain on/off control in rotation only")
    if station.sump.profile is not None or station.effect or electrical.power_model != "current":
        raise ValueError(f"station '{station.name}': the truth plant takes no profile, effect or load model")
    if len(station.mains) > 1 or main.delivery_level_m is not None or station.sump.volume_points is not None:
        raise ValueError(
            f"station '{station.name}': the truth plant takes one main, no delivery level and no points of volume"
        )
    pumps = len(station.pump)
    c0, c1, c2 = np.array([pump.coefficients for pump in station.pump]).T
    is_common = main.layout == "common"
    loss = main.friction_h2_m5 * HOUR_S**2
    return Spec(
        shutoff_m=c0,
        linear=-c1 * HOUR_S,
        square=-c2 * HOUR_S**2,
        head_factor=np.ones(pumps),
        ring_leak=np.zeros(pumps),
        rag_limit=np.zeros(pumps),
        rag_half_m3=np.ones(pumps),
        flap_opening_m=np.zeros(pumps),
        lift_m=main.lift_at_zero_m,
        own_loss=0.0 if is_common else loss,
        shared_loss=loss if is_common else 0.0,
        rated_flow=duty_m3h(station)[0] / HOUR_S,
        area_m2=station.sump.mean_area_m2,
        crest_m=control.start_levels_m[-1] + 3.0,
        ramp_s=control.ramp_s,
        rated_power_w=rated_power_w(station),
        start_m=np.array(control.start_levels_m),
        stop_m=np.array(control.stop_levels_m),
    )


def rated_power_w(station: Station) -> float:
    """Electrical power of a pump at its rated current. [W]."""
    electrical = station.electrical
    return math.sqrt(3.0) * electrical.voltage_v * electrical.rated_current_a * electrical.power_factor


def duty_m3h(station: Station) -> tuple[float, float]:
    """Flow and head of the first pump alone at nominal speed, by bisection. [m³/h, m].

    Examples
    --------
    >>> table = {"name": "s", "sump": {"area_m2": 8.0}, "pump": [{"curve": [36.0, 0.0, -2.5e-4]}]}
    >>> flow_m3h, head_m = duty_m3h(Station.model_validate(table))
    >>> round(flow_m3h**2 * (2.5e-4 + 6.0e-4), 9), round(head_m, 3)
    (34.0, 26.0)
    """
    c0, c1, c2 = station.pump[0].coefficients
    main = station.mains[0]
    low, high = 0.0, 1.0
    while c0 + c1 * high + c2 * high**2 > main.lift_at_zero_m + main.friction_h2_m5 * high**2:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        excess_m = c0 - main.lift_at_zero_m + c1 * middle + (c2 - main.friction_h2_m5) * middle**2
        low, high = (middle, high) if excess_m > 0 else (low, middle)
    return low, c0 + c1 * low + c2 * low**2
