"""Effects beyond the plain model, one file each. The registry is the union itself."""

from collections.abc import Mapping
from typing import Annotated, Any, get_args

from pydantic import Field, TypeAdapter, ValidationError

from wetwell.protocols.errors import first_fault
from wetwell.protocols.station.station_file import Station
from wetwell.simulator.effects.controller.control_delay import ControlDelay
from wetwell.simulator.effects.controller.threshold_shift import ThresholdShift
from wetwell.simulator.effects.drive.constant_losses import ConstantLosses
from wetwell.simulator.effects.drive.load_dependent_power import LoadDependentPower
from wetwell.simulator.effects.drive.motor_slip import MotorSlip
from wetwell.simulator.effects.drive.ramp_shape import RampShape
from wetwell.simulator.effects.drive.supply_voltage_variation import SupplyVoltageVariation
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.effects.pump.check_valve_leak import CheckValveLeak
from wetwell.simulator.effects.pump.pump_wear import PumpWear
from wetwell.simulator.effects.pump.ragging import Ragging
from wetwell.simulator.effects.pump.sticking_check_valve import StickingCheckValve
from wetwell.simulator.effects.rising_main.air_pocket import AirPocket
from wetwell.simulator.effects.rising_main.common_header import CommonHeader
from wetwell.simulator.effects.rising_main.friction_bias import FrictionBias
from wetwell.simulator.effects.rising_main.level_dependent_static_head import LevelDependentStaticHead
from wetwell.simulator.effects.rising_main.static_head_bias import StaticHeadBias
from wetwell.simulator.effects.rising_main.water_inertia import WaterInertia
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection
from wetwell.simulator.effects.telemetry.channel_delay import ChannelDelay
from wetwell.simulator.effects.telemetry.flow_low_cutoff import FlowLowCutoff
from wetwell.simulator.effects.telemetry.flow_meter_gain import FlowMeterGain
from wetwell.simulator.effects.telemetry.flow_meter_lag import FlowMeterLag
from wetwell.simulator.effects.telemetry.head_sensor_offset import HeadSensorOffset
from wetwell.simulator.effects.telemetry.level_quantisation import LevelQuantisation
from wetwell.simulator.effects.telemetry.level_sensor_lag import LevelSensorLag
from wetwell.simulator.effects.telemetry.power_meter_gain import PowerMeterGain
from wetwell.simulator.effects.telemetry.report_by_exception import ReportByException
from wetwell.simulator.effects.wet_well.sump_area_profile import SumpAreaProfile
from wetwell.simulator.effects.wet_well.unmetered_inflow import UnmeteredInflow
from wetwell.simulator.parameters import PlantParameters, plant_parameters

AnyEffect = Annotated[
    AirPocket
    | ChannelDelay
    | CheckValveLeak
    | CommonHeader
    | ConstantLosses
    | ControlDelay
    | FlowLowCutoff
    | FlowMeterGain
    | FlowMeterLag
    | FrictionBias
    | HeadSensorOffset
    | LearntCorrection
    | LevelDependentStaticHead
    | LevelQuantisation
    | LevelSensorLag
    | LoadDependentPower
    | MotorSlip
    | PowerMeterGain
    | PumpWear
    | Ragging
    | RampShape
    | ReportByException
    | StaticHeadBias
    | StickingCheckValve
    | SumpAreaProfile
    | SupplyVoltageVariation
    | ThresholdShift
    | UnmeteredInflow
    | WaterInertia,
    Field(discriminator="name"),
]
EFFECTS: dict[str, type[Effect]] = {
    effect.model_fields["name"].default: effect for effect in get_args(get_args(AnyEffect)[0])
}
LIBRARY = tuple(name for name, effect in EFFECTS.items() if effect.is_told and not effect.is_learnt)
"""Names of the effects that a diagnosis may tell."""
COMPANIONS = tuple(name for name, effect in EFFECTS.items() if effect.is_everywhere)
"""Names of those that each real station has, which a diagnosis sizes beside what it tells."""
_ADAPTER: TypeAdapter[tuple[AnyEffect, ...]] = TypeAdapter(tuple[AnyEffect, ...])


def effects_of(station: Station) -> tuple[Effect, ...]:
    """Effects that a station file names, checked.

    Raises
    ------
    ValueError
        If a name is unknown, a parameter breaks its rule, or a pump or main is not there; one line.
    """
    tables = [effect.model_dump() for effect in station.effect]
    try:
        effects = _ADAPTER.validate_python(tables)
    except ValidationError as error:
        raise ValueError(f"station '{station.name}': {first_fault(error, 'effect')}") from error
    for number, effect in enumerate(effects, start=1):
        for part, count in (("pump", len(station.pump)), ("main", len(station.mains))):
            place = getattr(effect, part, 0)
            if place > count:
                raise ValueError(
                    f"station '{station.name}': effect[{number}].{part}: got {place}, "
                    f"there {'is' if count == 1 else 'are'} {count} {part}{'' if count == 1 else 's'}"
                )
    return effects


def effective_parameters(station: Station) -> PlantParameters:
    """Parameters of a station under its effects: each works on what those before it in the file left.

    Of two that set the same thing (a lag, a delay, a deadband), the later counts; factors multiply, shifts add up.

    Raises
    ------
    ValueError
        As `effects_of`, or if an effect does not fit the station; one line.
    """
    parameters = plant_parameters(station)
    for number, effect in enumerate(effects_of(station), start=1):
        try:
            parameters = effect.modify(parameters)
        except ValueError as error:
            raise ValueError(f"station '{station.name}': effect[{number}]: {error}") from error
    return parameters


def effect_table() -> list[dict[str, Any]]:
    """Every effect as its class says: name, component, parameters and what it does.

    Returns
    -------
    rows : list of dict
        A parameter has a name, and of unit, low, high, choices, neutral, default and parts what there is.
    """
    return [
        {
            "name": name,
            "component": effect.component,
            "parameters": _parameters(effect),
            "summary": (effect.__doc__ or "").split("\n", 1)[0],
        }
        for name, effect in EFFECTS.items()
    ]


def _parameters(effect: type[Effect]) -> list[dict[str, Any]]:
    keys = {"unit": "unit", "minimum": "low", "maximum": "high", "enum": "choices", "default": "default"}
    whole = effect.model_json_schema()
    return [
        {"name": name}
        | {new: schema[old] for old, new in keys.items() if old in schema}
        | ({"neutral": effect.neutral[name]} if name in effect.neutral else {})
        | ({"parts": _keys(whole, schema["items"])} if "items" in schema else {})
        for name, schema in whole["properties"].items()
        if name != "name"
    ]


def _keys(whole: Mapping[str, Any], items: Mapping[str, str]) -> list[str]:
    """Keys of the tables that a parameter is a list of."""
    return list(whole["$defs"][items["$ref"].rpartition("/")[2]]["properties"])
