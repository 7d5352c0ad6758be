"""A true station as an input file of EPA SWMM 5: storage, variable-speed pumps, force mains under the dynamic wave.

The force mains are as long and wide as their loss and a settling time of half a second ask for, with the
friction of Darcy and Weisbach as SWMM computes it.
Pumps are of its type 5, whose curve follows the speed by the affinity laws.
"""

import math

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.truth.kernel import area_m2
from wetwell.sim2real.truth.spec import Spec

SWMM_LIBRARY = (
    "friction_bias",
    "static_head_bias",
    "level_dependent_static_head",
    "common_header",
    "sump_area_profile",
    "unmetered_inflow",
    "pump_wear",
    "check_valve_leak",
    "supply_voltage_variation",
    "control_delay",
    "threshold_shift",
    "level_sensor_lag",
    "level_quantisation",
    "flow_meter_gain",
    "flow_meter_lag",
    "head_sensor_offset",
    "power_meter_gain",
    "channel_delay",
    "report_by_exception",
)
SWMM_OPEN = (
    "flow_meter_drift",
    "head_sensor_scale",
    "second_sump",
    "clock_drift",
    "power_meter_drift",
    "foam",
    "speed_hunting",
)
"""Deviations that SWMM can express, or that lie in control and telemetry."""

SWMM_RAMPS_S = (1, 2)
"""Ramps of soft starters. In longer ones its pumps move no water at twice the head they need, then let go. [s]"""

ROUTING_STEP_S = 0.5
MAIN_SETTLING_S, HEADER_SETTLING_S = 0.4, 0.65
"""Inertance of the mains, times rated flow over head: with more or less, pumps stick or surge in ramps. [s]"""
FASTEST_M_S = 14.0
"""Where all pumps run. From 15.24 m/s on, its bound of 50 ft/s, the solver has friction grow like the flow only: a
fifth of it is lost at 18 m/s. A wet well that is full drives the water a little faster than at the beginning."""
ROUGHNESS_MM = 0.1
GRAVITY = 9.81
WATER_NU_M2_S = 1.1e-6
_POINTS = 300


def swmm_input(spec: Spec, level_m: float) -> str:
    """Text of the input file for one day at most, to be driven step by step from outside.

    Nodes: `WELL`, `JOINT{i}` behind pump i, `HEADER`, `OUT` or `OUT{i}`; links: `PUMP{i}`, `MAIN`, `MAIN{i}`.

    Parameters
    ----------
    spec : Spec
    level_m : float
        At the beginning. [m]
    """
    numbers = range(1, spec.shutoff_m.size + 1)
    total = spec.own_loss + spec.shared_loss
    settling_s = HEADER_SETTLING_S if spec.shared_loss > 0 else MAIN_SETTLING_S
    inertance = settling_s * (spec.lift_m + total * spec.rated_flow**2) / spec.rated_flow
    own, shared = (
        _main(loss, inertance * loss / total, spec.rated_flow, _most_flow(spec, pumps)) if loss > 0 else None
        for loss, pumps in ((spec.own_loss, 1), (spec.shared_loss, spec.shutoff_m.size))
    )
    junctions, outfalls, conduits, sections, pumps, curves = [], [], [], [], [], []
    for i in numbers:
        curves += _curve_lines(spec, i)
        joint = f"JOINT{i}" if own else "HEADER"
        pumps.append(f"PUMP{i} WELL {joint} CURVE{i} OFF 0 0")
        if own:
            end = "HEADER" if shared else f"OUT{i}"
            junctions.append(_junction(f"JOINT{i}", own[1], spec.lift_m))
            outfalls += [] if shared else [f"OUT{i} 0 FIXED {spec.lift_m + level_m:.9g} NO"]
            conduits.append(f"MAIN{i} JOINT{i} {end} {own[0]:.9g} 0.012 0 0 0 0")
            sections.append(f"MAIN{i} FORCE_MAIN {own[1]:.9g} {ROUGHNESS_MM} 0 0 1")
    if shared:
        junctions.append(_junction("HEADER", shared[1], spec.lift_m))
        outfalls.append(f"OUT 0 FIXED {spec.lift_m + level_m:.9g} NO")
        conduits.append(f"MAIN HEADER OUT {shared[0]:.9g} 0.012 0 0 0 0")
        sections.append(f"MAIN FORCE_MAIN {shared[1]:.9g} {ROUGHNESS_MM} 0 0 1")
    depths_m = np.linspace(0.0, spec.crest_m, _POINTS)
    curves += [
        f"AREA {'STORAGE ' if k == 0 else ''}{depth_m:.9g} {area_m2(spec, depth_m):.9g}"
        for k, depth_m in enumerate(depths_m)
    ]
    parts = {
        "OPTIONS": _OPTIONS,
        "OUTFALLS": outfalls,
        "STORAGE": [f"WELL 0 {spec.crest_m:.9g} {level_m:.9g} TABULAR AREA 0 0"],
        "JUNCTIONS": junctions,
        "CONDUITS": conduits,
        "XSECTIONS": sections,
        "PUMPS": pumps,
        "CURVES": curves,
    }
    return "\n".join(line for title, lines in parts.items() for line in (f"[{title}]", *lines)) + "\n"


_OPTIONS = f"""FLOW_UNITS CMS
FLOW_ROUTING DYNWAVE
FORCE_MAIN_EQUATION D-W
SURCHARGE_METHOD EXTRAN
INERTIAL_DAMPING NONE
LINK_OFFSETS DEPTH
START_DATE 01/06/2025
START_TIME 00:00:00
REPORT_START_DATE 01/06/2025
REPORT_START_TIME 00:00:00
END_DATE 02/06/2025
END_TIME 00:00:00
REPORT_STEP 24:00:00
WET_STEP 01:00:00
DRY_STEP 01:00:00
ROUTING_STEP {ROUTING_STEP_S}
VARIABLE_STEP 0
THREADS 1
HEAD_TOLERANCE 0.000001
MAX_TRIALS 20
MIN_SURFAREA 0.01
SKIP_STEADY_STATE NO""".splitlines()


def _junction(name: str, diameter_m: float, lift_m: float) -> str:
    return f"{name} 0 {diameter_m:.9g} {lift_m:.9g} 200 0"


def _most_flow(spec: Spec, pumps: int) -> float:
    """Flow of so many pumps at full speed, each as strong as the strongest of them. [m³/s]."""
    square = spec.square.min() + spec.own_loss + spec.shared_loss * pumps**2
    linear, head_m = spec.linear.min(), spec.shutoff_m.max() - spec.lift_m
    return float(pumps * (math.sqrt(linear**2 + 4.0 * square * head_m) - linear) / (2.0 * square))


def _main(loss: float, inertance: float, rated_flow: float, most_flow: float) -> tuple[float, float]:
    r"""Length and diameter of a pipe of given loss, at the rated flow, and inertance. [m, m].

    $$K = \frac{8 f \ell}{\pi^2 g D^5}, \qquad I = \frac{4 \ell}{\pi g D^2} \quad\Rightarrow\quad
    D^3 = \frac{2 f I}{\pi K}$$

    with f from Colebrook's equation, by repetition. The pipe is wider, and so longer, where the water would be faster
    than SWMM's solver bears.
    """
    diameter_m, friction = 0.1, 0.02
    least_m = math.sqrt(4.0 * most_flow / (math.pi * FASTEST_M_S))
    for _ in range(50):
        friction = _friction_factor(diameter_m, rated_flow)
        diameter_m = max((2.0 * friction * inertance / (math.pi * loss)) ** (1.0 / 3.0), least_m)
    return loss * math.pi**2 * GRAVITY * diameter_m**5 / (8.0 * friction), diameter_m


def _friction_factor(diameter_m: float, flow: float) -> float:
    """Friction factor of Colebrook's equation. [1]."""
    reynolds = 4.0 * flow / (math.pi * diameter_m * WATER_NU_M2_S)
    root = 7.0
    for _ in range(30):
        root = -2.0 * math.log10(ROUGHNESS_MM / 1000.0 / (3.7 * diameter_m) + 2.51 * root / reynolds)
    return 1.0 / root**2


def _curve_lines(spec: Spec, number: int) -> list[str]:
    """Points (head, flow) of a pump, by rising head; what its worn ring lets back is taken off."""
    i = number - 1
    c0, c1, c2 = spec.shutoff_m[i], spec.linear[i], spec.square[i]
    run_out = (-c1 + math.sqrt(c1**2 + 4.0 * c2 * c0)) / (2.0 * c2)
    inner: Floats = np.linspace(run_out, 0.0, _POINTS)
    heads_m = np.maximum(c0 - c1 * inner - c2 * inner**2, 0.0)
    flows = inner - spec.ring_leak[i] * np.sqrt(heads_m)
    shut_m = np.interp(0.0, flows[::-1], heads_m[::-1])
    points = [(head_m, flow) for head_m, flow in zip(heads_m, flows, strict=True) if flow > 0.0 and head_m < shut_m]
    rows = [f"{spec.head_factor[i] * head_m:.9g} {flow:.9g}" for head_m, flow in (*points, (shut_m, 0.0))]
    return [f"CURVE{number} {'PUMP5 ' if k == 0 else ''}{row}" for k, row in enumerate(rows)]
