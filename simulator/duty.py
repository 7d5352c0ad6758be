"""Duty points of a station: what its owner can hold against the datasheet."""

from typing import Any

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.curve_fit import fit_error_m
from wetwell.protocols.station.rising_main import RisingMain
from wetwell.protocols.station.station_file import Station
from wetwell.simulator.hydraulics import main_flows, pump_head_m
from wetwell.simulator.parameters import PlantParameters, PumpParameters, plant_parameters
from wetwell.simulator.power import electrical_power_kw, hydraulic_power_kw, loaded_power_kw, shaft_power_kw

MIN_EXCESS = 0.01
"""Share by which a shut-off head must exceed the lift: what lies nearer is within the tolerance of any datasheet."""


def check_operable(station: str, parameters: PlantParameters) -> None:
    """Refuse a plant that could be simulated but not operated; its effects count.

    Raises
    ------
    ValueError
        If a stop level lies under the floor, the overflow not over the first start level, or the shut-off head of a
        pump in service at nominal speed does not exceed the static head at the last start level by `MIN_EXCESS`: it
        would turn and move no water. One line.
    """
    place = f"station '{station}'"
    if parameters.start_levels_m.size:
        _check_levels(place, parameters)
    highest_m = parameters.start_levels_m[-1] if parameters.start_levels_m.size else parameters.rated_level_m
    for number, pump in enumerate(parameters.pumps, start=1):
        static_head_m = parameters.mains[pump.main].static_head_at_m(highest_m)
        if pump.is_automatic and pump.c0 <= static_head_m * (1.0 + MIN_EXCESS):
            raise ValueError(
                f"{place}: pump[{number}]: curve does not meet the system curve: shut-off head {pump.c0:g} m must "
                f"exceed the static head of {static_head_m:g} m, effects included, by {MIN_EXCESS:.0%}, or no water "
                "flows"
            )


def _check_levels(place: str, parameters: PlantParameters) -> None:
    start_m, stop_m, crest_m = parameters.start_levels_m, parameters.stop_levels_m, parameters.overflow_level_m
    if stop_m[0] < parameters.profile["level_m"][0]:
        raise ValueError(
            f"{place}: control.stop_levels_m[1] = {stop_m[0]:g} lies under the floor: the pump would never stop"
        )
    if crest_m <= start_m[0]:
        raise ValueError(
            f"{place}: sump.overflow_level_m: got {crest_m:g}, must lie over control.start_levels_m[1] = "
            f"{start_m[0]:g}, or the wet well overflows before a pump starts"
        )


def duty_flows_m3h(parameters: PlantParameters, speed_ratio: Floats, level_m: float | Floats) -> Floats:
    """Duty flows of pumps at their speeds, each main for itself; without air, inertia or faults.

    Parameters
    ----------
    parameters : PlantParameters
    speed_ratio : (..., pumps) array
        Speed over nominal speed; 0 stands. [1]
    level_m : (...) array or float
        Level in the wet well; NaN where nobody knows it. [m]

    Returns
    -------
    flow_m3h : (..., pumps) array
        NaN where a lift depends on a level that nobody knows. [m³/h]
    """
    speeds = speed_ratio.reshape(-1, len(parameters.pumps))
    levels_m = np.broadcast_to(level_m, len(speeds))
    flow_m3h = np.full(speeds.shape, np.nan)
    for m, main in enumerate(parameters.mains):
        pumps = np.flatnonzero([pump.main == m for pump in parameters.pumps])
        lift_m = main.static_heads_m(levels_m)
        known = np.isfinite(lift_m)
        flows = np.zeros((np.count_nonzero(known), speeds.shape[1]))
        main_flows(
            pumps,
            parameters.curves,
            np.ascontiguousarray(speeds[known]),
            lift_m[known],
            main.own_h2_m5,
            main.friction_h2_m5 - main.own_h2_m5,
            main.linear_flow_m3h,
            main.is_common_header,
            np.array([pump.valve_leak_m3h for pump in parameters.pumps]),
            flows,
        )
        flow_m3h[np.ix_(known, pumps)] = flows[:, pumps]
    return flow_m3h.reshape(speed_ratio.shape)


def duty_table(station: Station) -> dict[str, object]:
    """Duty points of each pump alone and of all pumps together, at nominal speed.

    Returns
    -------
    table : dict
        `level_m`: where the wet well is meanwhile; `mains`: name, static head there, friction and layout of each;
        `curves`: coefficients, and the root mean square misfit of a curve fitted to datasheet points;
        `each_pump_alone` and `all_pumps_together`: flow, head and power; `total_flow_m3h` of all together.
    """
    count = len(station.pump)
    alone = [_duty(station, [i == pump for i in range(count)])[pump] for pump in range(count)]
    together = _duty(station, [True] * count)
    return {
        "station": station.name,
        "title": station.title,
        "level_m": round(station.middle_level_m, 3),
        "mains": [_main(station, main) for main in station.mains],
        "curves": [_curve(station, pump) for pump in range(count)],
        "each_pump_alone": alone,
        "all_pumps_together": together,
        "total_flow_m3h": round(sum(row["flow_m3h"] for row in together), 2),
    }


def _main(station: Station, main: RisingMain) -> dict[str, object]:
    return {
        "main": main.name,
        "static_head_m": round(main.static_head_at_m(station.middle_level_m), 3),
        "delivery_level_m": main.delivery_level_m,
        "friction_h2_m5": main.friction_h2_m5,
        "layout": main.layout,
    }


def _named(station: Station, pump: int) -> dict[str, Any]:
    """Number, name and main of a pump."""
    main = station.mains[station.main_of_pump[pump]]
    return {"pump": pump + 1, "name": station.pump_labels[pump], "main": main.name}


def _curve(station: Station, number: int) -> dict[str, object]:
    pump = station.pump[number]
    c0, c1, c2 = pump.coefficients
    misfit_m = None if pump.points is None else round(fit_error_m(pump.points, pump.coefficients), 4)
    return _named(station, number) | {"c0": c0, "c1": c1, "c2": c2, "fit_error_m": misfit_m}


def _duty(station: Station, running: list[bool]) -> list[dict[str, Any]]:
    parameters = plant_parameters(station)
    flows_m3h = duty_flows_m3h(parameters, np.array(running, dtype=float), parameters.rated_level_m)
    rows: list[dict[str, Any]] = []
    for number, (pump, flow_m3h) in enumerate(zip(parameters.pumps, flows_m3h.tolist(), strict=True)):
        head_m = pump_head_m(pump.c0, pump.c1, pump.c2, 1.0, flow_m3h)
        shaft_kw, electrical_kw = _powers_kw(station, pump, flow_m3h, head_m)
        rows.append(
            _named(station, number)
            | {
                "flow_m3h": round(flow_m3h, 2),
                "head_m": round(head_m, 2),
                "hydraulic_power_kw": round(hydraulic_power_kw(flow_m3h, head_m), 2),
                "shaft_power_kw": round(shaft_kw, 2),
                "electrical_power_kw": round(electrical_kw, 2),
            }
        )
    return rows


def _powers_kw(station: Station, pump: PumpParameters, flow_m3h: float, head_m: float) -> tuple[float, float]:
    """Shaft power and electrical power at nominal speed, by the power model of the station."""
    electrical = station.electrical
    if electrical.power_model == "load":
        shaft_kw = shaft_power_kw(1.0, flow_m3h, pump.rated_flow_m3h, pump.rated_shaft_kw, pump.shutoff_power_share)
        efficiencies = electrical.motor_efficiency, electrical.drive_efficiency
        return shaft_kw, loaded_power_kw(shaft_kw, pump.rated_shaft_kw, *efficiencies)
    shaft_kw = hydraulic_power_kw(flow_m3h, head_m) / electrical.efficiency
    return shaft_kw, electrical_power_kw(
        electrical.voltage_v, electrical.rated_current_a, electrical.power_factor, 1.0
    )
