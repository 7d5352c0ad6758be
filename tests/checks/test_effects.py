"""What holds for every registered effect, so that a new one is checked without a test of its own."""

import json
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.station.station_file import EffectTable, Station, load_station
from wetwell.services.stations import find_station
from wetwell.simulator.effects import EFFECTS, effect_table, effective_parameters, effects_of
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

EXPECTED = {
    "rising_main": {
        "friction_bias",
        "static_head_bias",
        "level_dependent_static_head",
        "common_header",
        "water_inertia",
        "air_pocket",
    },
    "sump": {"sump_area_profile", "unmetered_inflow"},
    "pump": {"pump_wear", "ragging", "check_valve_leak", "sticking_check_valve"},
    "drive": {
        "constant_losses",
        "load_dependent_power",
        "motor_slip",
        "ramp_shape",
        "supply_voltage_variation",
    },
    "controller": {"control_delay", "threshold_shift"},
    "level_sensor": {"level_sensor_lag", "level_quantisation"},
    "flow_meter": {"flow_meter_gain", "flow_meter_lag", "flow_low_cutoff"},
    "head_sensor": {"head_sensor_offset"},
    "power_meter": {"power_meter_gain"},
    "telemetry": {"channel_delay", "report_by_exception"},
    "station": {"learnt_correction"},
}
BESIDE = {"constant_losses": (EFFECTS["load_dependent_power"](share=1.0),)}
"""What has to act for another one to show: losses are those of a power that follows the load."""
NEEDED = {"channel": "flow_m3h", "term": "head_loss"}
DOCS = Path(__file__).parents[2] / "docs" / "effects.md"
RISING_AND_IDLE = RecordedInflow(time_s=[0.0, 1200.0, 2400.0], flow_m3h=[300.0, 60.0, 180.0])
"""Two pumps at once, then single runs with idling between."""

every_effect = pytest.mark.parametrize(("name", "effect"), EFFECTS.items(), ids=EFFECTS)
DEADBANDS = {"level_m": 0.3, "inflow_m3h": 130, "frequency_hz": 7, "flow_m3h": 50, "head_m": 3, "power_kw": 3}
"""Larger than some of the steps of each channel."""


def made(effect, share):
    """An effect whose strengths are this share of the way from neutral to their upper limits."""
    rows = {
        row["name"]: row
        for row in next(row for row in effect_table() if EFFECTS[row["name"]] is effect)["parameters"]
    }
    strengths = {name: value + share * (rows[name]["high"] - value) for name, value in effect.neutral.items()}
    return effect(**{name: NEEDED[name] for name in rows if name in NEEDED}, **strengths)


def under(station, *effects):
    return station.model_copy(
        update={"effect": tuple(EffectTable(**effect.model_dump(mode="json")) for effect in effects)}
    )


def run(station, seconds=3600, seed=3):
    scenario = Scenario(name="hour", initial_level_m=1.5, inflow=RISING_AND_IDLE)
    recording = Simulation(station, scenario, seed=seed).advance(seconds)
    return {**recording.columns, **recording.truth}


def bits(columns):
    return {name: values.tobytes() for name, values in columns.items()}


@pytest.fixture(scope="module")
def plain(alpha):
    return bits(run(alpha))


def test_registry_holds_the_library():
    assert set(EFFECTS) >= set().union(*EXPECTED.values())
    for component, names in EXPECTED.items():
        assert {EFFECTS[name].component for name in names} == {component}
    assert list(EFFECTS) == sorted(EFFECTS)


@every_effect
def test_name_is_the_registry_key_and_the_file(name, effect):
    assert made(effect, 0.25).name == name
    assert effect.__module__.startswith("wetwell.simulator.effects.")
    assert effect.__module__.rpartition(".")[2] == name


@every_effect
def test_is_frozen(name, effect):
    one = made(effect, 0.25)
    for field in effect.model_fields:
        with pytest.raises(ValidationError, match="frozen"):
            setattr(one, field, getattr(one, field))
    assert one.name == name


@every_effect
def test_unknown_key_is_refused_in_one_line(name, effect, alpha):
    table = EffectTable(**made(effect, 0.25).model_dump(), strenght=1.0)
    with pytest.raises(ValueError, match="strenght") as caught:
        effects_of(alpha.model_copy(update={"effect": (table,)}))
    assert str(caught.value) == f"station 'alpha': effect[1].{name}.strenght: unknown key"


@every_effect
def test_every_number_has_range_unit_and_refuses_what_lies_outside(name, effect):
    table = made(effect, 0.25).model_dump()
    rows = next(row for row in effect_table() if row["name"] == name)["parameters"]
    for row in rows:
        if "choices" in row or "parts" in row or row["name"] in {"pump", "main"}:
            continue
        assert row["unit"]
        assert row["low"] < row["high"]
        assert row["name"].endswith(unit_suffix(row["unit"]))
        for value in (row["low"] - 1e-6, row["high"] * (1 + 1e-6), float("nan")):
            with pytest.raises(ValidationError):
                effect(**(table | {row["name"]: value}))
        for limit in (row["low"], row["high"]):
            effect(**(table | {row["name"]: limit}))


def unit_suffix(unit):
    return {"m": "_m", "s": "_s", "h": "_h", "m³/h": "_m3h", "s²/m²": "_s2_m2"}.get(unit, "")


@every_effect
def test_docstring_has_equation_parameters_and_reference(name, effect):
    text = effect.__doc__
    assert text.count("$$") == 2
    assert "Parameters\n" in text
    assert "References\n" in text
    for field in set(effect.model_fields) - {"name"}:
        assert f"    {field} : " in text, f"{name}: parameter {field} is not described"


@every_effect
def test_docs_have_a_row_that_names_component_and_parameters(name, effect):
    (row,) = [line for line in DOCS.read_text(encoding="utf-8").splitlines() if line.startswith(f"| `{name}` ")]
    assert f"| {effect.component} |" in row
    for field in set(effect.model_fields) - {"name"}:
        assert f"`{field}`" in row


def test_docs_name_no_effect_that_is_not_registered():
    rows = [line for line in DOCS.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    assert [row.split("`")[1] for row in rows] == list(EFFECTS)


@every_effect
def test_zero_strength_changes_no_bit(name, effect, alpha, plain):
    if not effect.neutral:
        pytest.skip(f"{name} has no neutral value: its presence is its strength")
    assert bits(run(under(alpha, made(effect, 0.0)))) == plain


@every_effect
def test_strength_changes_something_and_same_seed_gives_same_bytes(name, effect, alpha):
    beside = BESIDE.get(name, ())
    station = under(alpha, *beside, made(effect, 0.25))
    changed = run(station)
    for column, values in changed.items():
        assert values.dtype.kind == "U" or np.isfinite(values).all(), f"{name}: {column}"
    assert bits(changed) == bits(run(station))
    assert bits(changed) != bits(run(under(alpha, *beside)))


@every_effect
def test_blocks_of_any_length_give_the_same_bytes(name, effect, alpha):
    station = under(alpha, made(effect, 0.25))
    scenario = Scenario(name="hour", initial_level_m=1.5, inflow=RISING_AND_IDLE)
    whole = Simulation(station, scenario, seed=3).advance(1500).columns
    simulation = Simulation(station, scenario, seed=3)
    parts = [simulation.advance(seconds).columns for seconds in (1, 98, 401, 1000)]
    for column, values in whole.items():
        assert np.concatenate([part[column] for part in parts]).tobytes() == values.tobytes(), f"{name}: {column}"


@every_effect
def test_station_survives_toml(name, effect, alpha, tmp_path):
    station = under(alpha, made(effect, 0.25))
    table = station.model_dump(mode="json", exclude_none=True)
    path = tmp_path / "station.toml"
    path.write_text("".join(f"{key} = {in_toml(value)}\n" for key, value in table.items()), encoding="utf-8")
    again = load_station(path)
    assert again == station
    assert effects_of(again) == effects_of(station) == (made(effect, 0.25),), name


def in_toml(value):
    """TOML text of a value; tables become inline tables."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {in_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(in_toml, value)) + "]"
    return json.dumps(value)


@pytest.mark.parametrize("channel", DEADBANDS)
@pytest.mark.parametrize("name", ["channel_delay", "report_by_exception"])
def test_telemetry_effects_reach_their_channel_and_no_other(name, channel, quiet_alpha):
    strength = {"delay_s": 20.0} if name == "channel_delay" else {"deadband": DEADBANDS[channel]}
    plain, changed = run(quiet_alpha), run(under(quiet_alpha, EFFECTS[name](channel=channel, **strength)))
    differing = {column for column in plain if plain[column].tobytes() != changed[column].tobytes()}
    assert differing
    allowed = {channel} | {f"pump{i}_{channel}" for i in (1, 2, 3)}
    if channel == "frequency_hz":
        allowed |= {f"pump{i}_running" for i in (1, 2, 3)}
    assert differing <= allowed


@pytest.mark.parametrize(
    ("tables", "rule"),
    [
        ([{"name": "nope"}], "station 'alpha': effect[1]: input tag 'nope'"),
        ([{"name": "friction_bias"}], "station 'alpha': effect[1].friction_bias.factor: missing"),
        ([{"name": "motor_slip", "slip": 0.2}], "effect[1].motor_slip.slip: got 0.2, input should be less than"),
        (
            [{"name": "motor_slip", "slip": 0.1}, {"name": "ragging", "speed_loss": 0.1, "pump": 4}],
            "effect[2].pump: got 4",
        ),
        (
            [{"name": "channel_delay", "channel": "level", "delay_s": 1}],
            "effect[1].channel_delay.channel: got 'level'",
        ),
        (
            [{"name": "threshold_shift", "stop_m": 1.5}],
            "threshold_shift: with start_m = 0, stop_m = 1.5: stop_levels_m[1] = 2 must lie under start_levels_m[1]",
        ),
    ],
)
def test_bad_effects_are_refused_in_one_line(tables, rule, alpha, tmp_path):
    station = alpha.model_copy(update={"effect": tuple(EffectTable(**table) for table in tables)})
    with pytest.raises(ValueError, match="effect") as caught:
        effective_parameters(station)
    line = str(caught.value)
    assert "\n" not in line
    assert rule in line
    path = tmp_path / "bad.toml"
    table = station.model_dump(mode="json", exclude_none=True)
    path.write_text("".join(f"{key} = {in_toml(value)}\n" for key, value in table.items()), encoding="utf-8")
    with pytest.raises(ConfigError) as refused:
        find_station(str(path))
    assert str(refused.value) == f"{path}: {line}"


def test_effects_work_on_what_those_before_left(alpha):
    friction, header = EFFECTS["friction_bias"](factor=1.5), EFFECTS["common_header"](shared_fraction=0.7)
    both = effective_parameters(under(alpha, friction, header, friction))
    assert both.mains[0].friction_h2_m5 == pytest.approx(6e-4 * 2.25)
    assert both.mains[0].is_common_header
    assert both.mains[0].shared_friction == 0.7
    wear = EFFECTS["pump_wear"]
    worn = effective_parameters(under(alpha, wear(head_loss=0.1, pump=2), wear(head_loss=0.5, pump=0)))
    np.testing.assert_allclose(worn.curves[:, 0], 36.0 * np.array([0.5, 0.45, 0.5]))


def test_order_matters_only_where_two_effects_set_the_same_thing(alpha):
    effects = [made(effect, 0.25) for effect in EFFECTS.values()]
    forward, backward = (run(under(alpha, *some), seconds=900) for some in (effects, effects[::-1]))
    for column, values in forward.items():
        if values.dtype.kind != "U":
            np.testing.assert_allclose(values, backward[column], rtol=1e-9, atol=1e-9, err_msg=column)


def test_effect_table_is_json_and_one_sentence_each():
    table = json.loads(json.dumps(effect_table()))
    assert [row["name"] for row in table] == list(EFFECTS)
    for row in table:
        assert row["summary"].endswith("."), row["name"]


def test_effects_fit_a_station_with_a_profile(alpha):
    sump = alpha.sump.model_copy(update={"profile": ((0.0, 4.0), (0.5, 6.0), (3.0, 8.0))})
    station = Station.model_validate(alpha.model_copy(update={"sump": sump}).model_dump())
    effect = EFFECTS["sump_area_profile"](bottom_factor=0.5, height_m=1.0)
    profile = effective_parameters(under(station, effect)).profile
    np.testing.assert_allclose(profile["level_m"], [0.0, 0.5, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(profile["area_m2"], [2.0, 4.5, 6.4, 7.2, 8.0])
