"""The paper's station as an input file of EPA SWMM 5, for the benchmark and for the reference test.

Two forms: with force mains (conduits in which SWMM solves the dynamic wave), or with the friction taken off the pump
curves, so that only level, duty and switching are left to compare.
"""

from collections.abc import Sequence

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.station_file import Station

SECONDS_PER_HOUR = 3600.0
INFLOW_STEP_S = 300
CURVE_STEP_M3H = 0.5
MAIN_LENGTH_M, MAIN_DIAMETER_M, MAIN_ROUGHNESS_MM = 1506.0, 0.2, 0.2
"""Darcy-Weisbach with f = 0.02: k = 8 f L / (pi² g D⁵) = 6.0e-4 h²/m⁵."""

OPTIONS = """[OPTIONS]
FLOW_UNITS CMS
FLOW_ROUTING DYNWAVE
FORCE_MAIN_EQUATION D-W
LINK_OFFSETS DEPTH
START_DATE 01/01/2025
START_TIME 00:00:00
REPORT_START_DATE 01/01/2025
REPORT_START_TIME 00:00:00
END_DATE 01/02/2025
END_TIME 00:00:00
REPORT_STEP 01:00:00
WET_STEP 01:00:00
DRY_STEP 01:00:00
ROUTING_STEP 1
VARIABLE_STEP 0
THREADS 1
SKIP_STEADY_STATE NO
"""
PRECISE = "HEAD_TOLERANCE 0.000001\nMAX_TRIALS 20"


def swmm_input(
    station: Station, inflow_m3h: Sequence[float], *, initial_level_m: float, force_mains: bool, precise: bool = False
) -> str:
    """Text of the input file for one day; the lift is measured from the wet well's floor and falls with the level.

    Parameters
    ----------
    station : Station
        Its pumps, levels, area, lift and (without force mains) friction are taken.
    inflow_m3h : sequence of float
        One value for each `INFLOW_STEP_S`, linear between them. [m³/h]
    initial_level_m : float
        [m]
    force_mains : bool
        Whether each pump works on a conduit, or on a curve without its friction.
    precise : bool
        Whether the heads are iterated to 1e-6 instead of SWMM's default of 1.5e-3 m.
    """
    numbers = range(1, len(station.pump) + 1)
    main = station.rising_main
    lines = [OPTIONS, *([PRECISE] if precise else [])]
    lines += ["[OUTFALLS]", *(f"OUT{i} 0 FIXED {main.static_head_m} NO" for i in numbers)]
    lines += ["[STORAGE]", f"WELL 0 6 {initial_level_m} FUNCTIONAL 0 0 {station.sump.area_m2} 0 0"]
    if force_mains:
        lines += ["[JUNCTIONS]", *(f"JOINT{i} 0 60 0 60 0" for i in numbers)]
        lines += ["[CONDUITS]", *(f"MAIN{i} JOINT{i} OUT{i} {MAIN_LENGTH_M} 0.012 0 0 0 0" for i in numbers)]
        lines += [
            "[XSECTIONS]",
            *(f"MAIN{i} FORCE_MAIN {MAIN_DIAMETER_M} {MAIN_ROUGHNESS_MM} 0 0 1" for i in numbers),
        ]
    end = "JOINT" if force_mains else "OUT"
    lines += ["[PUMPS]", *(f"PUMP{i} WELL {end}{i} CURVE{i} OFF 0 0" for i in numbers)]
    lines.append("[CURVES]")
    for i, pump in enumerate(station.pump, start=1):
        lines += _curve_lines(f"CURVE{i}", pump.coefficients, 0.0 if force_mains else main.friction_h2_m5)
    lines.append("[CONTROLS]")
    levels = zip(numbers, station.control.start_levels_m, station.control.stop_levels_m, strict=True)
    for i, start_m, stop_m in levels:
        lines.append(f"RULE START{i}\nIF NODE WELL DEPTH >= {start_m}\nTHEN PUMP PUMP{i} STATUS = ON\n")
        lines.append(f"RULE STOP{i}\nIF NODE WELL DEPTH <= {stop_m}\nTHEN PUMP PUMP{i} STATUS = OFF\n")
    lines += ["[INFLOWS]", "WELL FLOW Q FLOW 1.0 1.0", "[TIMESERIES]"]
    for step, flow_m3h in enumerate(inflow_m3h):
        minutes = step * INFLOW_STEP_S // 60
        lines.append(f"Q {minutes // 60}:{minutes % 60:02d} {flow_m3h / SECONDS_PER_HOUR:.12g}")
    return "\n".join(lines) + "\n"


def _curve_lines(name: str, curve: tuple[float, float, float], friction_h2_m5: float) -> list[str]:
    """Points (head in m, flow in m³/s) of a pump of type 3, by rising head."""
    c0, c1, c2 = curve
    c2 -= friction_h2_m5
    run_out_m3h = 2.0 * c0 / (-c1 + np.sqrt(c1**2 - 4.0 * c2 * c0))
    flows_m3h: Floats = np.arange(0.0, run_out_m3h + CURVE_STEP_M3H, CURVE_STEP_M3H)[::-1]
    heads_m = c0 + c1 * flows_m3h + c2 * flows_m3h**2
    rows = [
        f"{head_m:.12g} {flow_m3h / SECONDS_PER_HOUR:.12g}"
        for head_m, flow_m3h in zip(heads_m, flows_m3h, strict=True)
    ]
    return [f"{name} PUMP3 {rows[0]}", *(f"{name} {row}" for row in rows[1:])]
