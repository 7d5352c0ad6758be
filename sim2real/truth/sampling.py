"""Stations and cases at random, new ones for every seed, around no station in particular."""

import math
from dataclasses import replace

import numpy as np

from wetwell.protocols.quantities import PUMP_METERS, AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import LEARNING_S
from wetwell.sim2real.truth.case import Deviation, FaultKind, TrueInflow, TruthCase, TruthFault
from wetwell.sim2real.truth.deviations import DEVIATIONS
from wetwell.sim2real.truth.kernel import LEVEL
from wetwell.sim2real.truth.parts import draw_of, rounded
from wetwell.sim2real.truth.spec import HOUR_S, WATER_N_M3, duty_m3h
from wetwell.sim2real.truth.truth_plant import passage_of

RAMPS_S = (6, 15)
"""Shortest and longest ramp of a drive. [s]"""


def station_of(
    name: str, rng: np.random.Generator, *, needs_two_pumps: bool = False, ramps_s: tuple[int, int] = RAMPS_S
) -> Station:
    """A plausible station of one to four pumps.

    Duty, curve, lift, friction, wet well, levels, ramp and noise are all drawn; the wet well is emptied by one pump
    within one to five minutes.

    Parameters
    ----------
    name : str
    rng : numpy.random.Generator
    needs_two_pumps : bool
        Whether at least two pumps with mains of their own are needed.
    ramps_s : (int, int)
        Shortest and longest ramp. [s]
    """
    pumps = int(rng.integers(2 if needs_two_pumps else 1, 5))
    flow_m3h, head_m = math.exp(rng.uniform(math.log(60.0), math.log(400.0))), rng.uniform(12.0, 40.0)
    rise_m, share = head_m * rng.uniform(0.2, 0.6), rng.uniform(0.0, 0.4)
    lift_m = head_m * rng.uniform(0.08, 0.6)
    depth_m = rng.uniform(0.8, 1.6)
    stop_m, start_step_m, stop_step_m = rng.uniform(0.4, 0.7), rng.uniform(0.15, 0.3), rng.uniform(0.1, 0.25)
    voltage_v, power_factor = 400.0, rng.uniform(0.82, 0.92)
    power_kw = WATER_N_M3 * flow_m3h / HOUR_S * head_m / rng.uniform(0.5, 0.7) / 1000.0
    is_common = not needs_two_pumps and rng.random() < 0.4
    table = {
        "name": name,
        "sump": {"area_m2": rounded(flow_m3h / HOUR_S * rng.uniform(60.0, 300.0) / depth_m)},
        "pump": [
            {
                "curve": [
                    rounded(head_m + rise_m),
                    rounded(-share * rise_m / flow_m3h),
                    rounded(-(1.0 - share) * rise_m / flow_m3h**2),
                ]
            }
        ]
        * pumps,
        "rising_main": {
            "static_head_m": rounded(lift_m),
            "friction_h2_m5": rounded((head_m - lift_m) / flow_m3h**2),
            "layout": "common" if is_common else "individual",
        },
        "control": {
            "start_levels_m": [rounded(stop_m + depth_m + n * start_step_m) for n in range(pumps)],
            "stop_levels_m": [rounded(stop_m + n * stop_step_m) for n in range(pumps)],
            "ramp_s": float(rng.integers(*ramps_s, endpoint=True)),
        },
        "electrical": {
            "voltage_v": voltage_v,
            "rated_current_a": rounded(power_kw * 1000.0 / (math.sqrt(3.0) * voltage_v * power_factor)),
            "power_factor": rounded(power_factor),
        },
        "sensors": {
            "flow_noise": rounded(rng.uniform(0.005, 0.015)),
            "head_noise": rounded(rng.uniform(0.005, 0.015)),
            "power_noise": rounded(rng.uniform(0.005, 0.015)),
            "inflow_noise": rounded(rng.uniform(0.005, 0.015)),
            "level_noise_m": rounded(rng.uniform(0.001, 0.004)),
        },
    }
    return Station.model_validate(table)


def inflow_of(station: Station, rng: np.random.Generator) -> TrueInflow:
    """An inflow that one pump carries by and large, with rain that needs a second one."""
    flow_m3h, _ = duty_m3h(station)
    has_more = len(station.pump) > 1
    most = (1.05 if station.mains[0].layout == "common" else 1.5) if has_more else 0.6
    return TrueInflow(
        mean_m3h=flow_m3h * rng.uniform(0.25, 0.5),
        swing=rng.uniform(0.2, 0.5),
        noise=rng.uniform(0.03, 0.1),
        noise_s=rng.uniform(300.0, 1800.0),
        rain_per_day=rng.uniform(5.0, 10.0),
        rain_m3h=flow_m3h * (rng.uniform(0.7, 1.1) if has_more else rng.uniform(0.1, 0.25)),
        rain_s=rng.uniform(600.0, 1800.0),
        most_m3h=most * flow_m3h,
    )


def case_of(
    names: tuple[str, ...],
    station_name: str,
    rng: np.random.Generator,
    *,
    seconds: int,
    slow_share: float = 0.0,
    ramps_s: tuple[int, int] = RAMPS_S,
) -> TruthCase:
    """A case with deviations of these names, at a new station, with parameters drawn for it.

    Parameters
    ----------
    names : tuple of str
        Keys of `DEVIATIONS`; empty for a truth that is as its file says.
    station_name : str
    rng : numpy.random.Generator
    seconds : int
        [s]
    slow_share : float
        Share of the sensors' variance that is slow. [1]
    ramps_s : (int, int)
        Shortest and longest ramp of the station. [s]

    Examples
    --------
    >>> case = case_of(("flow_meter_gain",), "s", np.random.default_rng(1), seconds=600)
    >>> [deviation.name for deviation in case.deviations], case == case_of(
    ...     ("flow_meter_gain",), "s", np.random.default_rng(1), seconds=600
    ... )
    (['flow_meter_gain'], True)
    """
    needs_two = any(DEVIATIONS[name].needs_two_pumps for name in names)
    station = station_of(station_name, rng, needs_two_pumps=needs_two, ramps_s=ramps_s)
    draw = draw_of(station, rng)
    deviations = tuple(Deviation(name=name, parameters=DEVIATIONS[name].draw(draw)) for name in names)
    control = station.control
    case = TruthCase(
        station=station,
        deviations=deviations,
        inflow=inflow_of(station, rng),
        seconds=seconds,
        seed=int(rng.integers(2**31)),
        initial_level_m=rounded(0.5 * (control.start_levels_m[0] + control.stop_levels_m[0])),
        slow_share=slow_share,
    )
    return _relieved(case)


def _relieved(case: TruthCase) -> TruthCase:
    """The case with so much inflow that its pumps, with their deviations, can carry it."""
    highest_m = case.station.control.start_levels_m[-1] + HIGH_WATER_M
    for _ in range(_TRIES):
        if passage_of(case).station_record[LEVEL].max() < highest_m:
            break
        inflow = replace(case.inflow, mean_m3h=RELIEF * case.inflow.mean_m3h, most_m3h=RELIEF * case.inflow.most_m3h)
        case = replace(case, inflow=inflow)
    return case


HIGH_WATER_M = 1.0
"""So far over the last start level the wet well may fill; it spills at three times that. [m]"""
RELIEF = 0.85
_TRIES = 8
_SENSED: tuple[AnalogueQuantity, ...] = ("level_m", *PUMP_METERS)


def faulty_case_of(
    kinds: tuple[FaultKind, ...],
    station_name: str,
    rng: np.random.Generator,
    *,
    seconds: int,
    slow_share: float = 0.0,
) -> TruthCase:
    """A case whose truth is as its file says, until faults of these kinds come.

    A fault begins after `LEARNING_S` and is full before the end; clogging and blockage grow for hours.

    Parameters
    ----------
    kinds : tuple of str
    station_name : str
    rng : numpy.random.Generator
    seconds : int
        More than `LEARNING_S`. [s]
    slow_share : float
        Share of the sensors' variance that is slow. [1]

    Raises
    ------
    ValueError
        If the case is too short for a fault.
    """
    if seconds < LEARNING_S + HOUR_S:
        raise ValueError(f"seconds: got {seconds}, a case with faults needs {LEARNING_S + HOUR_S:g}")
    case = case_of((), station_name, rng, seconds=seconds, slow_share=slow_share)
    return replace(case, faults=tuple(_fault_of(kind, case.station, seconds, rng) for kind in kinds))


def _fault_of(kind: FaultKind, station: Station, seconds: int, rng: np.random.Generator) -> TruthFault:
    _, head_m = duty_m3h(station)
    start_s = rng.uniform(LEARNING_S, LEARNING_S + 0.4 * (seconds - LEARNING_S))
    end_s = rng.uniform(start_s + 0.2 * (seconds - start_s), start_s + 0.7 * (seconds - start_s))
    pump = int(rng.integers(1, len(station.pump) + 1))
    channel = _SENSED[int(rng.integers(len(_SENSED)))]
    drawn = TruthFault(kind=kind, start_s=rounded(start_s), end_s=rounded(end_s))
    match kind:
        case "blockage":
            return replace(drawn, size=rounded(rng.uniform(0.04, 0.2)), pump=pump)
        case "clogging":
            return replace(drawn, size=rounded(rng.uniform(0.2, 1.0)))
        case "static_rise":
            return replace(drawn, size=rounded(head_m * rng.uniform(0.04, 0.15)))
        case _:
            size = _SENSOR_SIZES[channel] * rng.uniform(0.5, 1.5) * _scale(channel, station)
            return replace(
                drawn,
                size=rounded(size / 4.0 if kind == "sensor_drift" else size),
                pump=0 if channel == "level_m" else pump,
                channel=channel,
            )


_SENSOR_SIZES = {"level_m": 0.15, "flow_m3h": 0.12, "head_m": 0.12, "power_kw": 0.12}


def _scale(channel: str, station: Station) -> float:
    flow_m3h, head_m = duty_m3h(station)
    electrical = station.electrical
    power_kw = math.sqrt(3.0) * electrical.voltage_v * electrical.rated_current_a * electrical.power_factor / 1000.0
    return {"level_m": 1.0, "flow_m3h": flow_m3h, "head_m": head_m, "power_kw": power_kw}[channel]
