"""Items of a labelled set: a sampled station, inflow and fault, each from its seed and number alone.

Item k of seed S depends on S, k, the base stations and the length only, not on how many items there are or who makes
them: its generator comes from `numpy.random.SeedSequence(S, spawn_key=(k,))`. Classes take turns, and within a class
the kinds of faults, so that any run of consecutive items is balanced.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

import numpy as np
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from wetwell.protocols.quantities import STATION_QUANTITIES
from wetwell.protocols.station.control import Control
from wetwell.protocols.station.pump import Pump
from wetwell.protocols.station.rising_main import RisingMain
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.station.sump import Sump
from wetwell.protocols.timestamps import LEARNING_S
from wetwell.simulator.control.drivable import check_driven
from wetwell.simulator.duty import check_operable, duty_flows_m3h
from wetwell.simulator.effects import effective_parameters, effects_of
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.faults.profile import Profile, PumpFault, SensorFault, SystemFault
from wetwell.simulator.inflow import INFLOWS
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.power import electrical_power_kw
from wetwell.simulator.scenario import Scenario

FaultClass = Literal["normal", "pump_fault", "system_fault", "pump_and_system_fault", "sensor_fault"]

MIN_LENGTH_S = LEARNING_S + 3600.0
MIN_RAMP_S = 300.0
MAX_PUMPS = 4
DIGITS = 6
"""Significant digits of sampled values: files stay readable."""

SEVERITIES: dict[str, dict[str, tuple[float, float]]] = {
    "blockage": {"speed_loss": (0.03, 0.4)},
    "pipe_clogging": {"friction_rise": (0.1, 2.0), "static_rise_m": (0.05, 1.0)},
}
"""Ranges of what makes a kind severe, sampled log-uniformly, where those below are not good enough."""
SHARES = {"bias": (0.03, 0.4), "bias_per_hour": (0.005, 0.1), "leak_m3h": (0.03, 0.4)}
"""Ranges of parameters without default, as shares of what the channel, or one pump, has in health."""
DEFAULT_SEVERITY = (0.15, 1.3)
"""Range of the distance from the neutral value, as a share of that of the default, for all others."""

_TRIES = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One item: all that its recording is made from, and its label.

    Attributes
    ----------
    number : int
        k, from 0.
    seed : int
        Of the simulation.
    label : FaultClass
        The faults that it has; `truth_state` says when they act.
    station : Station
    scenario : Scenario
    """

    number: int
    seed: int
    label: FaultClass
    station: Station
    scenario: Scenario


def kinds_of(label: FaultClass) -> list[tuple[str, ...]]:
    """Kinds of faults, or pairs of them, that make a class; empty where the registry has none.

    Examples
    --------
    >>> kinds_of("normal")
    [()]
    >>> ("blockage",) in kinds_of("pump_fault"), ("pipe_clogging",) in kinds_of("system_fault")
    (True, True)
    """
    pump, system, sensor = (
        [kind for kind, fault in FAULTS.items() if issubclass(fault, base)]
        for base in (PumpFault, SystemFault, SensorFault)
    )
    match label:
        case "normal":
            return [()]
        case "pump_fault":
            return [(kind,) for kind in pump]
        case "system_fault":
            return [(kind,) for kind in system]
        case "sensor_fault":
            return [(kind,) for kind in sensor]
        case "pump_and_system_fault":
            return [(one, other) for one in pump for other in system]


def labels() -> tuple[FaultClass, ...]:
    """Classes that the registry of faults can make, in the order in which they take turns."""
    return tuple(label for label in get_args(FaultClass) if kinds_of(label))


def item_of(bases: Sequence[Station], seed: int, number: int, length_s: int) -> Item:
    """Item `number` of the set of a seed.

    Parameters
    ----------
    bases : sequence of Station
        Stations that are perturbed; they take turns.
    seed : int
        S, >= 0.
    number : int
        k, from 0.
    length_s : int
        Length of the recording, at least `MIN_LENGTH_S`. [s]

    Raises
    ------
    ValueError
        If the length is too short, nobody knows when a base starts its pumps, or no plausible station or fault can
        be sampled around a base.

    Examples
    --------
    >>> table = {"name": "s", "sump": {"area_m2": 8.0}, "pump": [{"curve": [36, -0.02, -1e-4]}]}
    >>> base = Station.model_validate(table)
    >>> item = item_of([base], seed=1, number=1, length_s=43_200)
    >>> item.label, item.station.name, item == item_of([base], 1, 1, 43_200)
    ('pump_fault', 's-000001', True)
    """
    if length_s < MIN_LENGTH_S:
        raise ValueError(
            f"an item must be at least {MIN_LENGTH_S / 86_400:.3f} days long, got {length_s / 86_400:.3f}"
        )
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
    for base in bases:
        check_driven(base)
    round_, turn = divmod(number, len(labels()))
    label = labels()[turn]
    kinds = kinds_of(label)
    station = _station(bases[round_ % len(bases)], number, rng)
    return Item(
        number=number,
        seed=int(rng.integers(2**31)),
        label=label,
        station=station,
        scenario=Scenario.model_validate(
            {
                "name": f"item-{number:06}",
                "description": label,
                "duration_s": length_s,
                "initial_level_m": _rounded(
                    rng.uniform(station.control.stop_levels_m[0], station.control.start_levels_m[0])
                ),
                "inflow": _inflow(station, rng),
                "fault": _faults(kinds[round_ % len(kinds)], station, length_s, rng),
            }
        ),
    )


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _station(base: Station, number: int, rng: np.random.Generator) -> Station:
    """A station like the base; drawn again where the draw breaks a rule of stations, or gives hardly any flow."""
    for _ in range(_TRIES):
        try:
            station = Station.model_validate(_station_table(base, number, rng))
            check_operable(station.name, effective_parameters(station))
        except ValueError:  # also pydantic's
            continue
        if _capacity_m3h(station) > 0.0:
            return station
    raise ValueError(f"station '{base.name}': no station like it could be sampled in {_TRIES} draws")


def _station_table(base: Station, number: int, rng: np.random.Generator) -> dict[str, Any]:
    pumps = int(rng.integers(1, MAX_PUMPS + 1))
    area = _log_uniform(rng, 0.6, 1.8)
    head, linear, square = rng.uniform(0.85, 1.15), _log_uniform(rng, 0.8, 1.25), _log_uniform(rng, 0.8, 1.25)
    sampled = [base.pump[i % len(base.pump)] for i in range(pumps)]
    served = sorted({base.main_of_pump[i % len(base.pump)] for i in range(pumps)})
    pump_tables = [_pump(pump, (float(head), linear, square), rng) for pump in sampled]
    mains = [_main(base.mains[m], base.middle_level_m, rng) for m in served]
    return {
        "name": f"{base.name[:57]}-{number:06}",
        "sump": _sump(base.sump, area),
        "pump": pump_tables,
        **({"rising_main": mains[0]} if base.main is None else {"main": mains}),
        "control": _control(base.control, pumps),
        "electrical": base.electrical.model_dump(),
        "sensors": {
            name: _rounded(value * _log_uniform(rng, 0.5, 2.0)) if "noise" in name else value
            for name, value in base.sensors.model_dump().items()
        },
        "effect": _effects(base, pumps, served),
    }


def _sump(base: Sump, area: float) -> dict[str, Any]:
    """The wet well with all its areas multiplied."""
    table = base.model_dump(exclude_none=True)
    if base.area_m2 is not None:
        table["area_m2"] = _rounded(base.area_m2 * area)
    for key in table.keys() & {"profile", "volume_points"}:
        table[key] = [(level_m, _rounded(value * area)) for level_m, value in table[key]]
    return table


def _pump(base: Pump, factors: tuple[float, float, float], rng: np.random.Generator) -> dict[str, Any]:
    own = rng.uniform(0.98, 1.02, 3)
    curve = [_rounded(c * f * o) for c, f, o in zip(base.coefficients, factors, own.tolist(), strict=True)]
    table: dict[str, Any] = {"curve": curve, "nominal_frequency_hz": base.nominal_frequency_hz, "main": base.main}
    if base.power_points is not None:
        scale = factors[0] * float(own[0])
        table["power_points"] = [(flow_m3h, _rounded(power_kw * scale)) for flow_m3h, power_kw in base.power_points]
    return table | {"efficiency_points": base.efficiency_points}


def _main(base: RisingMain, level_m: float, rng: np.random.Generator) -> dict[str, Any]:
    lift_m = base.static_head_at_m(level_m) * rng.uniform(0.6, 1.6)
    lift = {"static_head_m": _rounded(lift_m)}
    if base.delivery_level_m is not None:
        lift = {"delivery_level_m": _rounded(level_m + lift_m)}
    return lift | {
        "name": base.name,
        "friction_h2_m5": _rounded(base.friction_h2_m5 * _log_uniform(rng, 0.6, 1.7)),
        "layout": str(rng.choice(["individual", "common"])),
    }


def _control(base: Control, pumps: int) -> dict[str, Any]:
    """Levels for as many pumps, the further ones 0.2 m apart."""
    table = base.model_dump()
    for key in ("start_levels_m", "stop_levels_m"):
        levels_m = list(table[key][:pumps])
        levels_m += [round(levels_m[-1] + 0.2 * n, 3) for n in range(1, pumps - len(levels_m) + 1)]
        table[key] = levels_m
    in_service = [pump for pump in table["out_of_service"] if pump <= pumps]
    return table | {"out_of_service": in_service if len(in_service) < pumps else []}


def _effects(base: Station, pumps: int, served: list[int]) -> list[dict[str, Any]]:
    """Effects of the base on pumps and mains that are there, with the numbers that these have now."""
    numbers = {0: 0} | {place + 1: number for number, place in enumerate(served, start=1)}
    tables = []
    for effect, written in zip(effects_of(base), base.effect, strict=True):
        main = getattr(effect, "main", 0)
        if getattr(effect, "pump", 0) <= pumps and main in numbers:
            tables.append(written.model_dump() | ({"main": numbers[main]} if main else {}))
    return tables


def _capacity_m3h(station: Station) -> float:
    """Flow of pump 1 alone at nominal speed."""
    parameters = plant_parameters(station)
    speed_ratio = np.zeros(len(station.pump))
    speed_ratio[0] = 1.0
    return float(duty_flows_m3h(parameters, speed_ratio, parameters.rated_level_m)[0])


def _inflow(station: Station, rng: np.random.Generator) -> dict[str, Any]:
    """A model with its defaults, its flows scaled to what one pump of the station can pump."""
    models = [model() for model in INFLOWS.values() if not any(f.is_required() for f in model.model_fields.values())]
    model = models[int(rng.integers(len(models)))]
    scale = _capacity_m3h(station) / 200.0 * rng.uniform(0.6, 1.4)
    scaled: dict[str, Any] = _scaled(model.model_dump(), float(scale))
    return scaled


def _scaled(value: Any, scale: float, name: str = "") -> Any:
    """The same value with every flow in it multiplied."""
    if isinstance(value, dict):
        return {key: _scaled(part, scale, key) for key, part in value.items()}
    if name == "quantiles":
        return [(probability, _rounded(flow_m3h * scale)) for probability, flow_m3h in value]
    if name.endswith("_m3h"):
        return [_rounded(v * scale) for v in value] if isinstance(value, list | tuple) else _rounded(value * scale)
    return value


def _faults(kinds: Sequence[str], station: Station, length_s: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Faults whose times overlap: the second begins before the first is half grown."""
    faults: list[dict[str, Any]] = []
    start_s, latest_s = LEARNING_S, LEARNING_S + 0.6 * (length_s - LEARNING_S)
    for kind in kinds:
        onset_s = float(np.round(rng.uniform(start_s, latest_s)))
        ramp_s = float(np.round(_log_uniform(rng, MIN_RAMP_S, length_s - onset_s)))
        shapes = _choices(FAULTS[kind].model_fields["shape"])
        steady = [shape for shape in shapes if shape != "intermittent"]
        times = {
            "start_s": onset_s,
            "end_s": onset_s + ramp_s,
            "after": str(rng.choice(["hold", "clear"])),
            "shape": str(rng.choice(steady if len(kinds) > 1 else shapes)),
            "period_s": _rounded(_log_uniform(rng, 600.0, 7200.0)),
            "duty": _rounded(rng.uniform(0.2, 0.8)),
        }
        faults.append(_fault(FAULTS[kind], times, station, rng))
        start_s, latest_s = onset_s, onset_s + ramp_s * 0.5
    return faults


def _choices(field: FieldInfo) -> tuple[Any, ...]:
    return get_args(field.annotation) if get_origin(field.annotation) is Literal else ()


def _fault(fault: type[Profile], times: dict[str, Any], station: Station, rng: np.random.Generator) -> dict[str, Any]:
    """One fault; drawn again where the draw breaks a rule of its kind."""
    kind = fault.model_fields["kind"].default
    for _ in range(_TRIES):
        table = {"kind": kind, **times}
        choices = {name: _choices(field) for name, field in fault.model_fields.items() if name not in table}
        table |= {name: str(rng.choice(values)) for name, values in choices.items() if values}
        if "pump" in fault.model_fields:
            lowest = 1 if issubclass(fault, PumpFault) else 0
            pump = int(rng.integers(lowest, len(station.pump) + 1))
            table["pump"] = 0 if table.get("channel") in STATION_QUANTITIES else pump
        if "main" in fault.model_fields and len(station.mains) > 1:
            table["main"] = int(rng.integers(0, len(station.mains) + 1))
        table |= _strengths(fault, table, station, rng)
        try:
            return fault.model_validate(table).model_dump()
        except ValidationError:
            continue
    raise ValueError(f"fault '{kind}': its parameters could not be sampled; give them ranges in SEVERITIES")


def _strengths(
    fault: type[Profile], table: dict[str, Any], station: Station, rng: np.random.Generator
) -> dict[str, float]:
    """Sampled values of the parameters that make a fault severe, and of others that have no default."""
    ranges = SEVERITIES.get(table["kind"], {})
    factor = _log_uniform(rng, *DEFAULT_SEVERITY)
    values: dict[str, float] = {}
    for name, field in fault.model_fields.items():
        neutral = fault.neutral.get(name)
        if name in table or not (field.is_required() or isinstance(neutral, float)):
            continue
        if name in ranges:
            values[name] = _rounded(_log_uniform(rng, *ranges[name]))
        elif name in SHARES:
            value = _log_uniform(rng, *SHARES[name]) * _usual(table.get("channel", "flow_m3h"), station)
            values[name] = _rounded(value * (rng.choice([-1.0, 1.0]) if name.startswith("bias") else 1.0))
        elif isinstance(neutral, float) and not field.is_required():
            values[name] = _rounded(neutral + (field.default - neutral) * factor)
    return values


def _usual(channel: str, station: Station) -> float:
    """What a channel has about when a pump runs, in its unit."""
    match channel:
        case "level_m":
            return float(station.control.start_levels_m[0])
        case "head_m":
            return float(station.pump[0].coefficients[0])
        case "power_kw":
            electrical = station.electrical
            return electrical_power_kw(electrical.voltage_v, electrical.rated_current_a, electrical.power_factor, 1.0)
        case _:
            return _capacity_m3h(station)
