"""Examples are what the models take, and each stands at the key that it is one of."""

import json

import pytest

from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.order import Plan
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.modbus.device_map import DeviceFile
from wetwell.protocols.recordings.importers.mapping import TagMapping
from wetwell.protocols.station.station_file import Station
from wetwell.services.runtime.settings import Settings
from wetwell.services.schemas.described import tables_of
from wetwell.services.schemas.examples import add_examples, examples_of
from wetwell.services.schemas.messages import message_models, message_schema
from wetwell.services.schemas.registry import SCHEMAS, schema_named
from wetwell.sim2real.diagnosis.report import GapReport
from wetwell.sim2real.recording.preparation import Preparation
from wetwell.simulator.effects import effective_parameters
from wetwell.simulator.scenario import Scenario

MODELS = {
    "station": Station,
    "scenario": Scenario,
    "settings": Settings,
    "mapping": TagMapping,
    "preparation": Preparation,
    "plc": DeviceFile,
    "gap-report": GapReport,
    "verdict": Verdict,
    "sample": Sample,
    "alarm": Alarm,
}
EACH = [pytest.param(name, one, id=f"{name}-{n}") for name in SCHEMAS for n, one in enumerate(examples_of(name))]


def test_each_schema_has_one():
    assert {name for name in SCHEMAS if examples_of(name)} == set(SCHEMAS)
    assert MODELS.keys() == SCHEMAS.keys() - {"recording"}


@pytest.mark.parametrize(("name", "example"), EACH)
def test_the_schema_takes_it(name, example, validator):
    assert [error.message for error in validator(schema_named(name)).iter_errors(example)] == []


@pytest.mark.parametrize(
    ("name", "example"),
    [one for one in EACH if one.values[0] in MODELS and "file" not in one.values[1].get("inflow", ())],
)
def test_the_model_takes_it(name, example):
    model = MODELS[name].model_validate_json(json.dumps(example))
    if isinstance(model, Station):
        effective_parameters(model)


@pytest.mark.parametrize("name", SCHEMAS)
def test_what_a_key_shows_is_allowed_there(name, validator):
    schema = schema_named(name)
    shown = [
        (key, value, {**rule, "$defs": schema.get("$defs", {})})
        for table in (schema, *schema.get("$defs", {}).values())
        for key, rule in table.get("properties", {}).items()
        for value in rule.get("examples", ())
    ]
    assert shown
    for key, value, rule in shown:
        assert validator(rule).is_valid(value), key


def unseen(schema):
    """Keys of a schema and its tables without a meaning in words, or without a value to see."""
    for table in (schema, *schema.get("$defs", {}).values()):
        for key, rule in {**table.get("properties", {}), **table.get("patternProperties", {})}.items():
            is_shown = rule.get("examples") or rule.get("default") is not None or "const" in rule
            if len(rule.get("description", "").split()) < 2 or not (is_shown or list(tables_of(schema, rule))):
                yield f"{table['title']}.{key}"


@pytest.mark.parametrize("name", SCHEMAS)
def test_each_key_has_a_meaning_in_words_and_a_value_to_see(name):
    assert list(unseen(schema_named(name))) == []


@pytest.mark.parametrize("model", list(message_models()), ids=lambda model: model.__name__)
def test_each_key_of_a_message_has_too_and_the_model_takes_its_example(model):
    others = set(schema_named("station")["$defs"]) | {"Station"} if model is Plan else set()
    assert [key for key in unseen(message_schema(model)) if key.partition(".")[0] not in others] == []
    (example,) = examples_of(model.__name__.lower())
    model.model_validate_json(json.dumps(example))
    assert example.keys() <= message_schema(model)["properties"].keys()


def test_the_first_example_counts_and_tables_are_looked_into():
    inner = {"title": "Inner", "properties": {"kind": {"const": "a"}, "size_m": {"type": "number"}}}
    other = {"title": "Other", "properties": {"kind": {"const": "b"}, "size_m": {"type": "number"}}}
    schema = {
        "properties": {
            "name": {"type": "string"},
            "part": {"type": "array", "items": {"oneOf": [{"$ref": "#/$defs/Inner"}, {"$ref": "#/$defs/Other"}]}},
        },
        "$defs": {"Inner": inner, "Other": other},
    }
    first = {"name": "n", "unknown": 1, "part": [{"kind": "b", "size_m": 2.0}]}
    add_examples(schema, [first, {"name": "m", "part": [{"kind": "a", "size_m": 3.0}, {"kind": "b", "size_m": 4.0}]}])
    assert schema["properties"]["name"]["examples"] == ["n"]
    assert "examples" not in schema["properties"]["part"]
    assert [one["properties"]["size_m"]["examples"] for one in (inner, other)] == [[3.0], [2.0]]
