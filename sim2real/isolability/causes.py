"""Effects and faults that steady running can show, each at a size that matters."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wetwell.protocols.quantities import STATION_QUANTITIES
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.isolability.cause import Cause
from wetwell.simulator.effects import EFFECTS, effect_table
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.parameters import PlantParameters

MATERIAL = 0.05
"""Share of the rated flow or head under which nobody would act. [1]"""
SHAPED_SHARE = 0.5
"""Share of the load in the power from which its form is varied. [1]"""
SHAPED = 0.2
"""By so much the shaft power at no flow is another share of the rated one, in another form. [1]"""
VALVE_SHARE = 0.05
"""Share of an open valve in the friction of the main, as `PartlyClosedValve` has it. [1]"""
NEVER_NEGATIVE = frozenset(
    {"level_dependent_static_head", "common_header", "pump_wear", "motor_slip", "unmetered_inflow"}
)
"""Effects that cannot be negative."""

_PARAMETERS = {row["name"]: row["parameters"] for row in effect_table()}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sizes:
    """Material sizes at a station, times a share: of friction, head, flow and power; and its plant and levels."""

    share: float
    rise: float
    lost_m: float
    lost_m3h: float
    lost_kw: float
    low_m: float
    high_m: float
    plant: PlantParameters


def causes_of(station: Station, plant: PlantParameters, share: float = 1.0) -> tuple[Cause, ...]:
    """All causes at the sizes of a station: `MATERIAL` of the rated flow and head of its first pump.

    What friction, wear and slip take has the size at which they take or give that head at the rated duty. Faults
    are those of the first pump, its meters, and the main.

    Parameters
    ----------
    station : Station
    plant : PlantParameters
        Of the station.
    share : float
        Of the material size at which causes are made; small ones are linear. [1]
    """
    pump, main = plant.pumps[0], plant.main_of(0)
    flow_m3h = pump.rated_flow_m3h
    head_m = pump.c0 + pump.c1 * flow_m3h + pump.c2 * flow_m3h**2
    friction_m = main.friction_h2_m5 * flow_m3h**2
    part = share * MATERIAL
    low_m, high_m = _levels_m(station)
    sizes = _Sizes(
        share=share,
        rise=part * head_m / friction_m if friction_m > 0.0 else share,
        lost_m=part * head_m,
        lost_m3h=part * flow_m3h,
        lost_kw=part * _power_kw(station),
        low_m=low_m,
        high_m=high_m,
        plant=plant,
    )
    return (*_effects(sizes), *_faults(sizes))


def _effects(sizes: _Sizes) -> tuple[Cause, ...]:
    part = sizes.share * MATERIAL
    is_shared = any(main.is_common_header for main in sizes.plant.mains)
    forms: dict[str, list[dict[str, Any]]] = {
        "friction_bias": [{"factor": 1.0 + sizes.rise}],
        "static_head_bias": [{"offset_m": sizes.lost_m}],
        "level_dependent_static_head": [_steeper(sizes)],
        "common_header": [{"shared_fraction": 1.0 if is_shared else sizes.share}],
        "pump_wear": [{"head_loss": part}, {"leak_m3h": sizes.lost_m3h}],
        "motor_slip": [{"slip": 0.5 * part}],
        "flow_meter_gain": [{"factor": 1.0 + part}],
        "head_sensor_offset": [{"offset_m": sizes.lost_m}],
        "load_dependent_power": _powers(sizes),
        "power_meter_gain": [{"factor": 1.0 + part}],
        "sump_area_profile": [
            {"bottom_factor": 1.0 - 2.0 * part, "height_m": sizes.high_m},
            {"bottom_factor": 1.0, "top_factor": 1.0 + 2.0 * part, "height_m": sizes.low_m},
        ],
        "unmetered_inflow": [{"flow_m3h": sizes.lost_m3h}],
    }
    return tuple(
        Cause(
            name=name,
            kind="effect",
            component=EFFECTS[name].component,
            forms=tuple(_within_limits(name, form) for form in given),
            is_one_sided=name in NEVER_NEGATIVE,
            share=sizes.share,
        )
        for name, given in forms.items()
    )


def _steeper(sizes: _Sizes) -> dict[str, float]:
    """A lift that falls by more for each metre of level than it does already, and is the same at the middle level."""
    main = sizes.plant.main_of(0)
    middle_m = 0.5 * (sizes.low_m + sizes.high_m)
    slope = main.lift_slope + sizes.share
    kept = main.lift_slope * (middle_m - main.lift_reference_m) / slope
    return {"slope": slope, "reference_level_m": middle_m - kept}


def _powers(sizes: _Sizes) -> list[dict[str, float]]:
    """Power that follows the load, and in another form; only the form, where it follows the load already.

    Nothing where it does so for each pump in a form of its own, which the effect, of all pumps alike, would undo.
    """
    plant, part = sizes.plant, sizes.share * MATERIAL
    at_shutoff = plant.pumps[0].shutoff_power_share
    kept = {"shutoff_share": at_shutoff}
    if plant.load_share >= 1.0:
        if any(pump.shutoff_power_share != at_shutoff for pump in plant.pumps):
            return [{"share": 0.0}]
        return [
            kept | {"share": 1.0, "rated_factor": 1.0 + part},
            {"share": 1.0, "shutoff_share": at_shutoff + SHAPED * sizes.share},
        ]
    mixed = {"share": SHAPED_SHARE * sizes.share}
    other = {"shutoff_share": at_shutoff + SHAPED}
    return [kept | mixed, other | mixed, kept | mixed | {"rated_factor": 1.0 + MATERIAL}]


def _within_limits(name: str, form: Mapping[str, float]) -> Effect:
    """Effect with its parameters cut off at the limits of the library."""
    fields = {row["name"]: row for row in _PARAMETERS[name]}
    return EFFECTS[name].model_validate(
        {key: min(max(value, fields[key]["low"]), fields[key]["high"]) for key, value in form.items()}
    )


def _faults(sizes: _Sizes) -> tuple[Cause, ...]:
    part = sizes.share * MATERIAL
    opening = max(float(1.0 / np.sqrt(1.0 + sizes.rise / VALVE_SHARE)), 0.01)
    of_pump: dict[str, list[Mapping[str, Any]]] = {
        "blockage": [{"speed_loss": 0.5 * part}],
        "impeller_wear": [{"head_loss": part}],
        "wear_ring_leakage": [{"leak_m3h": min(sizes.lost_m3h, 1000.0)}],
    }
    of_main: dict[str, list[Mapping[str, Any]]] = {
        "pipe_clogging": [{"friction_rise": sizes.rise}, {"friction_rise": 0.0, "static_rise_m": sizes.lost_m}],
        "partly_closed_valve": [{"opening": opening, "valve_share": VALVE_SHARE}],
        "air_pocket": [{"static_rise_m": sizes.lost_m}],
    }
    biases = {
        "flow_m3h": sizes.lost_m3h,
        "head_m": sizes.lost_m,
        "power_kw": sizes.lost_kw,
        "inflow_m3h": sizes.lost_m3h,
        "level_m": sizes.lost_m,
    }
    return (
        *(_fault(name, name, "pump", forms, {"pump": 1}, sizes) for name, forms in of_pump.items()),
        *(_fault(name, name, "system", forms, {}, sizes) for name, forms in of_main.items()),
        *(
            _fault(
                f"sensor_bias {channel}",
                "sensor_bias",
                "sensor",
                [{"bias": bias, "channel": channel}],
                {"pump": 0 if channel in STATION_QUANTITIES else 1},
                sizes,
            )
            for channel, bias in biases.items()
        ),
    )


def _fault(
    name: str,
    kind: str,
    component: str,
    forms: list[Mapping[str, Any]],
    more: Mapping[str, Any],
    sizes: _Sizes,
) -> Cause:
    whole = {"start_s": 0.0, "end_s": 1.0, "shape": "step", **more}
    return Cause(
        name=name,
        kind="fault",
        component=component,
        forms=tuple(FAULTS[kind].model_validate(whole | dict(form)) for form in forms),
        is_one_sided=component != "sensor",
        share=sizes.share,
    )


def _levels_m(station: Station) -> tuple[float, float]:
    control = station.control
    if control.is_external:
        return station.sump.floor_level_m, 2.0 * station.middle_level_m - station.sump.floor_level_m
    return control.stop_levels_m[0], control.start_levels_m[-1]


def _power_kw(station: Station) -> float:
    electrical = station.electrical
    return float(np.sqrt(3.0) * electrical.voltage_v * electrical.rated_current_a * electrical.power_factor / 1000.0)
