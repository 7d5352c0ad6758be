"""The schemas say what the models check: what one takes or refuses so does the other."""

import json
import tomllib
from pathlib import Path

import pytest
import tomli_w

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import Station
from wetwell.services.schemas.registry import SCHEMAS, schema_named
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.faults import FAULTS

ROOT = Path(__file__).parents[4]
STATIONS = sorted((ROOT / "simulator" / "stations").glob("*.toml"))
SCENARIOS = sorted((ROOT / "simulator" / "scenarios").glob("*.toml"))


@pytest.fixture
def errors(validator):
    return lambda name, value: [error.message for error in validator(schema_named(name)).iter_errors(value)]


@pytest.mark.parametrize("name", SCHEMAS)
def test_each_is_a_schema_and_says_what_it_is(name, validator):
    schema = schema_named(name)
    validator.check_schema(schema)
    assert schema["description"]
    assert schema["properties"]


@pytest.mark.parametrize(
    ("name", "path"),
    [*(("station", path) for path in STATIONS), *(("scenario", path) for path in SCENARIOS)],
    ids=lambda value: value if isinstance(value, str) else value.stem,
)
def test_files_that_come_with_the_package_are_taken(name, path, errors):
    assert errors(name, tomllib.loads(path.read_text())) == []


def test_the_example_of_the_gateway_is_taken(errors):
    assert errors("plc", tomllib.loads((ROOT / "services" / "gateway" / "example.toml").read_text())) == []


BASE = {"name": "s", "sump": {"area_m2": 8.0}, "pump": [{"curve": [36.0, -0.02, -1.0e-4]}]}


@pytest.mark.parametrize(
    "wrong",
    [
        {"sump": {"area_m2": -8.0}},
        {"sump": {"area": 8.0}},
        {"pump": []},
        {"name": "a b"},
        {"control": {"ramp_s": -1}},
        {"effect": [{"name": "worn_valve"}]},
        {"effect": [{"name": "flow_meter_gain", "factor": 17.0}]},
    ],
    ids=json.dumps,
)
def test_what_the_station_file_refuses_the_schema_refuses(wrong, tmp_path, run_wetwell, errors):
    assert errors("station", BASE) == []
    assert errors("station", BASE | wrong) != []
    file = tmp_path / "s.toml"
    file.write_text(tomli_w.dumps(BASE | wrong))
    assert run_wetwell("station", "check", file) == 2


def test_every_effect_and_fault_is_in_the_schema_with_its_parameters():
    effects = schema_named("station")["$defs"]
    assert all(model.__name__ in effects for model in EFFECTS.values())
    faults = schema_named("scenario")["$defs"]
    assert all(set(faults[model.__name__]["properties"]) == set(model.model_fields) for model in FAULTS.values())


def test_each_number_of_a_station_file_has_a_unit():
    schema = schema_named("station")
    numbers = [
        (name, key, rule)
        for name in ("Sump", "RisingMain", "Control", "Electrical", "Sensors", "Materiality", "Limits")
        for key, rule in schema["$defs"][name]["properties"].items()
        if rule.get("type") == "number"
    ]
    assert len(numbers) > 30
    assert [(name, key) for name, key, rule in numbers if "unit" not in rule] == []


def test_messages_are_taken(errors):
    verdict = Verdict(
        time=0, station="alpha", pump=2, state="normal", probability={"normal": 1.0}, evidence={}, window=(0, 1)
    )
    assert errors("verdict", json.loads(verdict.encode())) == []
    assert errors("verdict", json.loads(verdict.encode()) | {"state": "tired"}) != []


def test_rows_of_a_recording_are_taken(errors):
    row = {"time": "2025-01-01T00:00:00Z", "level_m": 1.0, "pump12_flow_m3h": None, "truth_fault": "blockage"}
    assert errors("recording", row) == []
    assert errors("recording", row | {"pump1_flow_m3h": "much"}) != []
    assert errors("recording", {"level_m": 1.0}) != []


def test_the_command_prints_them(run_wetwell, capsys):
    assert run_wetwell("schema", "station") == 0
    assert json.loads(capsys.readouterr().out) == schema_named("station")
    assert run_wetwell("schema", "--json") == 0
    assert [row["schema"] for row in json.loads(capsys.readouterr().out)["schemas"]] == list(SCHEMAS)
    assert run_wetwell("schema", "nosuch") == 2
    assert "schema 'nosuch' is none of station, scenario" in capsys.readouterr().err
    with pytest.raises(ConfigError):
        schema_named("nosuch")
    assert Station.__name__ == schema_named("station")["title"]
