"""Effects and faults that steady running can show, each at a size that matters."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wetwell.protocols.station.station_file import Station
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.faults.profile import Profile
from wetwell.simulator.parameters import PlantParameters

MATERIAL = 0.05
"""Share of the rated flow or head under which nobody would act. [1]"""
SHAPED_SHARE = 0.5
"""Share of the load in the power from which its form is varied. [1]"""

MOST_SIZES = 10.0
"""So many times its material size a cause is at the most: what is larger is seen without any of this. [1]"""
NEVER_NEGATIVE = frozenset(
    {"level_dependent_static_head", "common_header", "pump_wear", "motor_slip", "unmetered_inflow"}
)
"""Effects that cannot be negative."""

CauseKind = Literal["effect", "fault"]
Form = Effect | Profile


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """An effect of the library, or a fault that the detector looks for.

    Attributes
    ----------
    name : str
    kind : "effect" or "fault"
        Effects are told apart from effects, for they are there from the first day on; faults from faults.
    component : str
        Where it lies; of a fault pump, system or sensor.
    forms : tuple
        Of material size, the plain one first: what the cause may look like is a sum of their signatures.
    is_one_sided : bool
        Whether it cannot be less than nothing, as wear.
    """

    name: str
    kind: CauseKind
    component: str
    forms: tuple[Form, ...]
    is_one_sided: bool

    @property
    def signs(self) -> tuple[float, ...]:
        """Of what there is of it."""
        return (1.0,) if self.is_one_sided else (1.0, -1.0)

    @property
    def limits(self) -> tuple[float, float]:
        """Least and most of each form, in material sizes."""
        return (0.0 if self.is_one_sided else -MOST_SIZES), MOST_SIZES


def causes_of(station: Station, plant: PlantParameters) -> tuple[Cause, ...]:
    """All causes at the sizes of a station: `MATERIAL` of the rated flow and head of its first pump.

    What friction, wear and slip take has the size at which they take or give that head at the rated duty. Faults
    are those of the first pump, its meters, and the main.

    Parameters
    ----------
    station : Station
    plant : PlantParameters
        Of the station.
    """
    pump, main = plant.pumps[0], plant.main_of(0)
    flow_m3h = pump.rated_flow_m3h
    head_m = pump.c0 + pump.c1 * flow_m3h + pump.c2 * flow_m3h**2
    lost_m, lost_m3h = MATERIAL * head_m, MATERIAL * flow_m3h
    friction_m = main.friction_h2_m5 * flow_m3h**2
    rise = lost_m / friction_m if friction_m > 0.0 else 1.0
    low_m, high_m = _levels_m(station)
    return (
        *_effects(rise, lost_m, lost_m3h, low_m, high_m),
        *_faults(rise, lost_m, lost_m3h, MATERIAL * _power_kw(station)),
    )


def _effects(rise: float, lost_m: float, lost_m3h: float, low_m: float, high_m: float) -> tuple[Cause, ...]:
    shaped = {"share": SHAPED_SHARE}
    forms: dict[str, list[dict[str, Any]]] = {
        "friction_bias": [{"factor": min(1.0 + rise, 5.0)}],
        "static_head_bias": [{"offset_m": lost_m}],
        "level_dependent_static_head": [{"slope": 1.0, "reference_level_m": 0.5 * (low_m + high_m)}],
        "common_header": [{"shared_fraction": 1.0}],
        "pump_wear": [{"head_loss": MATERIAL}, {"leak_m3h": min(lost_m3h, 60.0)}],
        "motor_slip": [{"slip": 0.5 * MATERIAL}],
        "flow_meter_gain": [{"factor": 1.0 + MATERIAL}],
        "head_sensor_offset": [{"offset_m": lost_m}],
        "load_dependent_power": [shaped, shaped | {"shutoff_share": 0.6}, shaped | {"rated_factor": 1.0 + MATERIAL}],
        "sump_area_profile": [
            {"bottom_factor": 1.0 - 2.0 * MATERIAL, "height_m": max(high_m, 0.1)},
            {"bottom_factor": 1.0, "top_factor": 1.0 + 2.0 * MATERIAL, "height_m": max(low_m, 0.1)},
        ],
        "unmetered_inflow": [{"flow_m3h": lost_m3h}],
    }
    return tuple(
        Cause(
            name=name,
            kind="effect",
            component=EFFECTS[name].component,
            forms=tuple(EFFECTS[name].model_validate(form) for form in given),
            is_one_sided=name in NEVER_NEGATIVE,
        )
        for name, given in forms.items()
    )


def _faults(rise: float, lost_m: float, lost_m3h: float, lost_kw: float) -> tuple[Cause, ...]:
    valve_share = 0.05
    opening = max(1.0 / np.sqrt(1.0 + rise / valve_share), 0.01)
    of_pump: dict[str, list[Mapping[str, Any]]] = {
        "blockage": [{"speed_loss": 0.5 * MATERIAL}],
        "impeller_wear": [{"head_loss": MATERIAL}],
        "wear_ring_leakage": [{"leak_m3h": lost_m3h}],
    }
    of_main: dict[str, list[Mapping[str, Any]]] = {
        "pipe_clogging": [{"friction_rise": rise}, {"friction_rise": 0.0, "static_rise_m": lost_m}],
        "partly_closed_valve": [{"opening": opening, "valve_share": valve_share}],
        "air_pocket": [{"static_rise_m": lost_m}],
    }
    biases = {"flow_m3h": lost_m3h, "head_m": lost_m, "power_kw": lost_kw, "inflow_m3h": lost_m3h, "level_m": lost_m}
    causes = [
        *(_fault(name, name, "pump", forms, {"pump": 1}) for name, forms in of_pump.items()),
        *(_fault(name, name, "system", forms, {}) for name, forms in of_main.items()),
        *(
            _fault(
                f"sensor_bias {channel}",
                "sensor_bias",
                "sensor",
                [{"bias": bias, "channel": channel}],
                {"pump": 0 if channel in {"level_m", "inflow_m3h"} else 1},
            )
            for channel, bias in biases.items()
        ),
    ]
    return tuple(causes)


def _fault(name: str, kind: str, component: str, forms: list[Mapping[str, Any]], more: Mapping[str, Any]) -> Cause:
    whole = {"start_s": 0.0, "end_s": 1.0, "shape": "step", **more}
    return Cause(
        name=name,
        kind="fault",
        component=component,
        forms=tuple(FAULTS[kind].model_validate(whole | dict(form)) for form in forms),
        is_one_sided=component != "sensor",
    )


def _levels_m(station: Station) -> tuple[float, float]:
    control = station.control
    if control.is_external:
        return station.sump.floor_level_m, 2.0 * station.middle_level_m - station.sump.floor_level_m
    return control.stop_levels_m[0], control.start_levels_m[-1]


def _power_kw(station: Station) -> float:
    electrical = station.electrical
    return float(np.sqrt(3.0) * electrical.voltage_v * electrical.rated_current_a * electrical.power_factor / 1000.0)
