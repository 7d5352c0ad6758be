"""The schemas by name: of files that people write, and of what programs read."""

from collections.abc import Callable, Mapping
from pkgutil import resolve_name
from typing import Any

from pydantic import TypeAdapter

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.quantities import HAND_COLUMNS, PUMP_QUANTITIES, STATION_QUANTITIES
from wetwell.services.schemas.described import describe, described_schema
from wetwell.services.schemas.examples import add_examples, examples_of

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def _station() -> dict[str, Any]:
    """Station file; a table `[[effect]]` is one of the effects of the library, with their parameters."""
    from wetwell.protocols.station.station_file import Station
    from wetwell.simulator.effects import EFFECTS, AnyEffect

    schema = described_schema(Station)
    effects = TypeAdapter(AnyEffect).json_schema(ref_template="#/$defs/{model}")
    schema["$defs"] |= effects.pop("$defs")
    schema["$defs"]["EffectTable"] = effects | {"description": "An effect beyond the plain model."}
    describe(schema, EFFECTS.values())
    return schema


def _scenario() -> dict[str, Any]:
    """Scenario file; a recorded inflow may name a recording, whose series then takes the place of its name."""
    from wetwell.simulator.scenario import Scenario

    schema = described_schema(Scenario)
    recorded = schema["$defs"]["RecordedInflow"]
    series = recorded["required"]
    del recorded["required"]
    recorded["properties"]["file"] = {
        "type": "string",
        "description": "Instead of the series: a recording with the column `inflow_m3h`, beside this file.",
    }
    recorded["oneOf"] = [{"required": ["file"]}, {"required": series}]
    return schema


def _recording() -> dict[str, Any]:
    """A row of a recording; the columns are the keys."""
    time = {"type": "string", "format": "date-time", "description": "ISO 8601 with a Z or an offset"}
    station = {name: _value(one.unit, one.description) for name, one in STATION_QUANTITIES.items()}
    pumps = {
        rf"^pump[1-9]\d*_{name}$": _value(one.unit, one.description.replace("{pump}", "i"))
        for name, one in PUMP_QUANTITIES.items()
    }
    hands = {name: {"enum": [0, 1, None], "description": said} for name, said in HAND_COLUMNS.items()}
    truth = {r"^truth_": {"description": "What only a simulator can know; no diagnosis reads it"}}
    return {
        "title": "Recording",
        "description": "A row of a recording: CSV, CSV.gz or Parquet. Empty or NaN is no value. Pumps count from 1.",
        "type": "object",
        "properties": {"time": time, **station, **hands},
        "patternProperties": pumps | truth,
        "required": ["time"],
    }


def _value(unit: str, description: str) -> dict[str, Any]:
    return {"type": ["number", "null"], "description": description} | ({"unit": unit} if unit else {})


def _read(model: str) -> Callable[[], dict[str, Any]]:
    return lambda: described_schema(resolve_name(model))


def _written(model: str) -> Callable[[], dict[str, Any]]:
    return lambda: described_schema(resolve_name(model), "serialization")


SCHEMAS: Mapping[str, tuple[str, Callable[[], dict[str, Any]]]] = {
    "station": ("station file, TOML", _station),
    "scenario": ("scenario file, TOML", _scenario),
    "settings": ("settings of the services, TOML", _read("wetwell.services.runtime.settings:Settings")),
    "recording": ("row of a recording, CSV or Parquet", _recording),
    "mapping": ("mapping of an export, TOML", _read("wetwell.protocols.recordings.importers.mapping:TagMapping")),
    "preparation": ("preparation of field data, TOML", _read("wetwell.sim2real.recording.preparation:Preparation")),
    "plc": ("PLCs that the gateway polls, TOML", _read("wetwell.protocols.modbus.device_map:DeviceFile")),
    "gap-report": ("report.json of a diagnosis", _written("wetwell.sim2real.diagnosis.report:GapReport")),
    "verdict": ("line of verdicts.jsonl, message on the bus", _written("wetwell.protocols.messages.verdict:Verdict")),
    "sample": ("sample, message on the bus", _written("wetwell.protocols.messages.sample:Sample")),
    "alarm": ("alarm, message on the bus", _written("wetwell.protocols.messages.alarm:Alarm")),
}
"""What each describes, and how it is made. A model is loaded with its schema: all together take half a second."""


def schema_named(name: str) -> dict[str, Any]:
    """JSON Schema, draft 2020-12, of a file or a message: each key with meaning, unit, default, rule and example.

    Raises
    ------
    ConfigError
        If there is none of this name.
    """
    if name not in SCHEMAS:
        raise ConfigError(f"schema '{name}' is none of {', '.join(SCHEMAS)}")
    schema = {"$schema": DIALECT} | SCHEMAS[name][1]()
    add_examples(schema, examples_of(name))
    return schema
