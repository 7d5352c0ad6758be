"""Duty points of a station at nominal speed: what its owner can hold against the datasheet."""

from typing import Any

import numpy as np

from wetwell.protocols.station.curve_fit import fit_error_m
from wetwell.protocols.station.pump import Pump
from wetwell.protocols.station.station_file import Station
from wetwell.simulator.hydraulics import common_flows, individual_flows, pump_head_m
from wetwell.simulator.parameters import PlantParameters, plant_parameters
from wetwell.simulator.power import electrical_power_kw, hydraulic_power_kw

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
    start_m, stop_m, crest_m = parameters.start_levels_m, parameters.stop_levels_m, parameters.overflow_level_m
    place = f"station '{station}'"
    if stop_m[0] < 0.0:
        raise ValueError(
            f"{place}: control.stop_levels_m[1] = {stop_m[0]:g} lies under the floor: the pump would never stop"
        )
    if crest_m <= start_m[0]:
        raise ValueError(
            f"{place}: sump.overflow_level_m: got {crest_m:g}, must lie over control.start_levels_m[1] = "
            f"{start_m[0]:g}, or the wet well overflows before a pump starts"
        )
    rise_m = parameters.lift_slope * (start_m[-1] - parameters.lift_reference_m)
    static_head_m = max(parameters.static_head_m - rise_m, 0.0)
    for number, pump in enumerate(parameters.pumps, start=1):
        if pump.is_automatic and pump.c0 <= static_head_m * (1.0 + MIN_EXCESS):
            raise ValueError(
                f"{place}: pump[{number}]: curve does not meet the system curve: shut-off head {pump.c0:g} m must "
                f"exceed the static head of {static_head_m:g} m, effects included, by {MIN_EXCESS:.0%}, or no water "
                "flows"
            )


def duty_table(station: Station) -> dict[str, object]:
    """Duty points of each pump alone and of all pumps together.

    Returns
    -------
    table : dict
        `curves`: coefficients, and the root mean square misfit of a curve fitted to datasheet points;
        `each_pump_alone` and `all_pumps_together`: flow, head and power; `total_flow_m3h` of all together.
    """
    count = len(station.pump)
    alone = [_duty(station, [i == pump for i in range(count)])[pump] for pump in range(count)]
    together = _duty(station, [True] * count)
    curves = [_curve(number, pump) for number, pump in enumerate(station.pump, start=1)]
    return {
        "station": station.name,
        "curves": curves,
        "each_pump_alone": alone,
        "all_pumps_together": together,
        "total_flow_m3h": round(sum(row["flow_m3h"] for row in together), 2),
    }


def _curve(number: int, pump: Pump) -> dict[str, object]:
    c0, c1, c2 = pump.coefficients
    misfit_m = None if pump.points is None else round(fit_error_m(pump.points, pump.coefficients), 4)
    return {"pump": number, "c0": c0, "c1": c1, "c2": c2, "fit_error_m": misfit_m}


def _duty(station: Station, running: list[bool]) -> list[dict[str, Any]]:
    parameters = plant_parameters(station)
    speed_ratio = np.array(running, dtype=float)
    flow_m3h = np.zeros(len(running))
    solve = common_flows if parameters.is_common_header else individual_flows
    solve(parameters.curves, speed_ratio, parameters.static_head_m, parameters.friction_h2_m5, 0.0, flow_m3h)
    electrical = station.electrical
    power_kw = electrical_power_kw(electrical.voltage_v, electrical.rated_current_a, electrical.power_factor, 1.0)
    rows: list[dict[str, Any]] = []
    for number, (curve, flow) in enumerate(zip(parameters.curves.tolist(), flow_m3h.tolist(), strict=True), start=1):
        head_m = pump_head_m(curve[0], curve[1], curve[2], 1.0, flow)
        rows.append(
            {
                "pump": number,
                "flow_m3h": round(flow, 2),
                "head_m": round(head_m, 2),
                "hydraulic_power_kw": round(hydraulic_power_kw(flow, head_m), 2),
                "shaft_power_kw": round(hydraulic_power_kw(flow, head_m) / electrical.efficiency, 2),
                "electrical_power_kw": round(power_kw, 2),
            }
        )
    return rows
