"""Stations and cases of the elastic plant at random: pumps of unequal size, other proportions, other weather."""

import math
from dataclasses import replace

import numpy as np

from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.truth.case import Deviation, TrueInflow, TruthCase
from wetwell.sim2real.truth.elastic.deviations import ELASTIC_DEVIATIONS
from wetwell.sim2real.truth.elastic.kernel import LEVEL
from wetwell.sim2real.truth.elastic.kind import Sizes, digits
from wetwell.sim2real.truth.elastic.plant import passage_of
from wetwell.sim2real.truth.elastic.spec import HOUR_S, WEIGHT_N_M3, duty

STARTS_PER_HOUR = (4.0, 15.0)
"""Fewest and most starts of a pump that empties and fills its well with half of its flow coming in. [1/h]"""
ROWS_PER_FILLING = 6.0
"""Rows at the least in the time in which a pump empties the well, where they are far apart. [1]"""
UNEQUAL_SHARE = 0.4
"""Share of the stations whose pumps differ. [1]"""
FULL_M = 0.9
"""So far over the last start level the wet well may fill. [m]"""
RELIEF, TRIES = 0.85, 10


def station_of(name: str, rng: np.random.Generator, *, needs_two_pumps: bool, every_s: int, by_load: bool) -> Station:
    """A plausible station of one to four pumps.

    Parameters
    ----------
    name : str
    rng : numpy.random.Generator
    needs_two_pumps : bool
        Whether at least two pumps with mains of their own are needed.
    every_s : int
        Rows are so far apart, and the well so large that a run has some. [s]
    by_load : bool
        Whether the file knows that the power follows the load.
    """
    pumps = int(rng.choice((2, 2, 3, 4) if needs_two_pumps else (1, 2, 2, 3, 4)))
    flow_m3h, head_m = float(np.exp(rng.normal(math.log(160.0), 0.6))), float(rng.gamma(6.0, 3.5)) + 6.0
    lift_m = head_m * rng.beta(2.0, 2.5) * 0.8
    reserve, bend = rng.uniform(1.25, 1.7), rng.uniform(0.55, 1.0)
    scales = rng.uniform(0.8, 1.25, pumps) if rng.random() < UNEQUAL_SHARE else np.ones(pumps)
    depth_m = rng.uniform(0.7, 1.8)
    stop_m = rng.uniform(0.35, 0.9)
    starts_m = stop_m + depth_m + np.concatenate([[0.0], np.cumsum(rng.uniform(0.12, 0.3, pumps - 1))])
    stops_m = stop_m + np.concatenate([[0.0], np.cumsum(rng.uniform(0.08, 0.2, pumps - 1))])
    cycle_s = max(HOUR_S / rng.uniform(*STARTS_PER_HOUR), 2.0 * ROWS_PER_FILLING * every_s)
    volume_m3 = flow_m3h / HOUR_S * cycle_s / 4.0
    efficiency, motor, drive = rng.uniform(0.55, 0.78), rng.uniform(0.86, 0.94), rng.uniform(0.95, 0.98)
    input_w = WEIGHT_N_M3 * flow_m3h / HOUR_S * head_m / (efficiency * motor * drive)
    power_factor, voltage_v = rng.uniform(0.8, 0.93), 400.0
    return Station.model_validate(
        {
            "name": name,
            "sump": {"area_m2": digits(volume_m3 / depth_m)},
            "pump": [{"curve": _curve(flow_m3h * float(scale), head_m, reserve, bend)} for scale in scales],
            "rising_main": {
                "static_head_m": digits(lift_m),
                "friction_h2_m5": digits((head_m - lift_m) / flow_m3h**2),
                "layout": "common" if not needs_two_pumps and rng.random() < 0.5 else "individual",
            },
            "control": {
                "start_levels_m": [digits(level_m) for level_m in starts_m],
                "stop_levels_m": [digits(level_m) for level_m in stops_m],
                "ramp_s": round(float(rng.uniform(4.0, 20.0)), 1),
            },
            "electrical": {
                "voltage_v": voltage_v,
                "rated_current_a": digits(input_w / (math.sqrt(3.0) * voltage_v * power_factor)),
                "power_factor": digits(power_factor),
                "efficiency": digits(efficiency),
                "motor_efficiency": digits(motor),
                "drive_efficiency": digits(drive),
                "shutoff_power_share": digits(rng.uniform(0.3, 0.55)),
                "power_model": "load" if by_load else "current",
            },
            "sensors": {
                "flow_noise": digits(rng.uniform(0.005, 0.02)),
                "head_noise": digits(rng.uniform(0.004, 0.015)),
                "power_noise": digits(rng.uniform(0.004, 0.02)),
                "inflow_noise": digits(rng.uniform(0.005, 0.03)),
                "level_noise_m": digits(rng.uniform(0.001, 0.005)),
            },
        }
    )


def _curve(flow_m3h: float, head_m: float, reserve: float, bend: float) -> list[float]:
    """Curve through a duty: shut-off head in duties, share of the fall that is a parabola."""
    fall_m = (reserve - 1.0) * head_m
    return [digits(reserve * head_m), digits(-(1.0 - bend) * fall_m / flow_m3h), digits(-bend * fall_m / flow_m3h**2)]


def inflow_of(station: Station, rng: np.random.Generator, every_s: int) -> TrueInflow:
    """An inflow that one pump carries in dry weather; storms need more, where there are more."""
    flow_m3h = duty(station, 0)[0] * HOUR_S
    has_more = len(station.pump) > 1
    stretch = max(every_s / 60.0, 1.0)
    most = 0.65 if not has_more else 1.05 if station.mains[0].layout == "common" else 1.5
    return TrueInflow(
        mean_m3h=digits(flow_m3h * rng.uniform(0.2, 0.5)),
        swing=digits(rng.uniform(0.2, 0.6)),
        noise=digits(rng.uniform(0.02, 0.12)),
        noise_s=digits(rng.uniform(200.0, 2400.0)),
        rain_per_day=digits(rng.uniform(3.0, 9.0) / stretch),
        rain_m3h=digits(flow_m3h * (rng.uniform(0.6, 1.2) if has_more else rng.uniform(0.1, 0.3))),
        rain_s=digits(rng.uniform(600.0, 2700.0) * stretch),
        most_m3h=digits(most * flow_m3h),
    )


def case_of(
    names: tuple[str, ...],
    station_name: str,
    rng: np.random.Generator,
    *,
    seconds: int,
    slow_share: float = 0.0,
    every_s: int = 1,
) -> TruthCase:
    """A case with deviations of these names, at a new station, with sizes drawn for it.

    Parameters
    ----------
    names : tuple of str
        Keys of `ELASTIC_DEVIATIONS`; empty for a truth that is as its file says.
    station_name : str
    rng : numpy.random.Generator
    seconds : int
        [s]
    slow_share : float
        Share of the sensors' variance that is slow. [1]
    every_s : int
        Seconds from row to row of what is stored.
    """
    station = station_of(
        station_name,
        rng,
        needs_two_pumps=any(ELASTIC_DEVIATIONS[name].needs_two_pumps for name in names),
        every_s=every_s,
        by_load="load_dependent_power" not in names,
    )
    sizes = Sizes(rng, station)
    deviations = tuple(Deviation(name=name, parameters=ELASTIC_DEVIATIONS[name].draw(sizes)) for name in names)
    case = TruthCase(
        station=station,
        deviations=deviations,
        inflow=inflow_of(station, rng, every_s),
        seconds=seconds,
        seed=int(rng.integers(2**31)),
        initial_level_m=digits(rng.uniform(station.control.stop_levels_m[0], station.control.start_levels_m[0])),
        slow_share=slow_share,
        slow_s=digits(rng.uniform(20.0, 90.0)),
    )
    highest_m = station.control.start_levels_m[-1] + FULL_M
    for _ in range(TRIES):
        if passage_of(case).station_record[LEVEL].max() < highest_m:
            break
        inflow = replace(case.inflow, mean_m3h=RELIEF * case.inflow.mean_m3h, most_m3h=RELIEF * case.inflow.most_m3h)
        case = replace(case, inflow=inflow)
    return case
