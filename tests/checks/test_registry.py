"""What holds for every registered fault and inflow, so that a new one is checked without a test of its own."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from wetwell.protocols.errors import first_fault
from wetwell.protocols.station import load_toml
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.faults.profile import PumpFault, Ramp
from wetwell.simulator.inflow import INFLOWS
from wetwell.simulator.plant import healthy_forcing
from wetwell.simulator.scenario import Scenario

REGISTERED = [*FAULTS.items(), *INFLOWS.items()]
NEEDED = {"pump": 2, "start_s": 20.0, "end_s": 60.0, "time_s": [0.0, 30.0, 45.0], "flow_m3h": [3.0, 0.0, 1e-7]}
EXPLAINED = {"recorded"}
"""Parts that are a lookup, not an equation."""

every_part = pytest.mark.parametrize(("kind", "part"), REGISTERED, ids=[kind for kind, _ in REGISTERED])
every_fault = pytest.mark.parametrize("part", FAULTS.values(), ids=FAULTS)
every_inflow = pytest.mark.parametrize("part", INFLOWS.values(), ids=INFLOWS)


def needed(part):
    return {name: NEEDED[name] for name, field in part.model_fields.items() if field.is_required()}


def in_toml(value):
    """TOML text of a value; tables become inline tables."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {in_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(in_toml, value)) + "]"
    return json.dumps(value)


def test_registries_are_not_empty():
    assert set(FAULTS) >= {"blockage", "pipe_clogging"}
    assert set(INFLOWS) >= {"empirical", "diurnal", "recorded"}


@every_part
def test_kind_is_the_registry_key(kind, part):
    assert part(**needed(part)).kind == kind


@every_part
def test_is_frozen(kind, part):
    made = part(**needed(part))
    for name in part.model_fields:
        with pytest.raises(ValidationError, match="frozen"):
            setattr(made, name, getattr(made, name))
    assert made.kind == kind


@every_part
def test_unknown_key_is_refused_in_one_line(kind, part):
    with pytest.raises(ValidationError) as caught:
        part(**needed(part), strenght=1.0)
    assert first_fault(caught.value) == "strenght: unknown key"
    place = "fault" if kind in FAULTS else "inflow"
    table = {"kind": kind, **needed(part), "strenght": 1.0}
    with pytest.raises(ValidationError) as caught:
        Scenario.model_validate({"name": "typo", place: [table] if place == "fault" else table})
    line = first_fault(caught.value)
    assert "\n" not in line
    assert line.endswith("strenght: unknown key")
    assert line.startswith("fault[1]" if place == "fault" else "inflow")


@every_part
def test_every_number_refuses_nan(kind, part):
    made = part(**needed(part))
    for name in part.model_fields:
        if isinstance(getattr(made, name), float):
            with pytest.raises(ValidationError) as caught:
                part(**(needed(part) | {name: float("nan")}))
            assert first_fault(caught.value).startswith(f"{name}: got nan"), kind


@every_part
def test_docstring_has_equation_parameters_and_reference(kind, part):
    text = part.__doc__
    assert text is not None
    if kind in EXPLAINED:
        assert len(text.split("Parameters")[0]) > 60
    else:
        assert text.count("$$") >= 2
        assert "References\n" in text
    assert "Parameters\n" in text
    for name in set(part.model_fields) - set(Ramp.model_fields) - {"kind", "pump"}:
        assert name in text, f"{kind}: parameter {name} is not described"


@every_part
def test_scenario_survives_toml(kind, part, tmp_path: Path):
    field = {"fault": (part(**needed(part)),)} if kind in FAULTS else {"inflow": part(**needed(part))}
    scenario = Scenario(name="round-trip", description='with "quotes"', duration_s=1.5e-3, start_time=1, **field)
    path = tmp_path / "scenario.toml"
    table = scenario.model_dump(mode="json")
    path.write_text("".join(f"{key} = {in_toml(value)}\n" for key, value in table.items()), encoding="utf-8")
    again = Scenario.model_validate(load_toml(path))
    assert type(again.inflow) is type(scenario.inflow)
    assert again.start_time == scenario.start_time
    assert again.model_dump(mode="json") == table
    assert table["fault" if kind in FAULTS else "inflow"]


@every_fault
def test_fault_of_zero_strength_is_identity(part):
    strengths = set(part.model_fields) - set(Ramp.model_fields) - set(PumpFault.model_fields) - {"kind"}
    nothing = part(**needed(part), **dict.fromkeys(strengths, 0.0))
    forcing, untouched = (healthy_forcing(np.linspace(0, 50, 100), pumps=3) for _ in range(2))
    nothing.apply(forcing, np.arange(100.0))
    assert all(
        left.tobytes() == right.tobytes() for left, right in zip(forcing.arrays, untouched.arrays, strict=True)
    )


def part_of(forcing, first, last):
    """Views of some of the seconds of a forcing."""
    views = {field.name: getattr(forcing, field.name) for field in fields(forcing) if field.name != "arrays"}
    return replace(forcing, **{name: array[..., first:last] for name, array in views.items()})


@every_fault
def test_fault_acts_only_in_its_time_and_in_any_blocks(part):
    fault = part(**(needed(part) | {"after": "clear"}))
    time_s = np.arange(100.0)
    whole, parts, untouched = (healthy_forcing(np.linspace(0, 50, 100), pumps=3, with_sensors=True) for _ in range(3))
    fault.apply(whole, time_s)
    for first, last in ((0, 1), (1, 37), (37, 37), (37, 100)):
        fault.apply(part_of(parts, first, last), time_s[first:last])
    assert all(left.tobytes() == right.tobytes() for left, right in zip(whole.arrays, parts.arrays, strict=True))
    changed = np.zeros(100, dtype=bool)
    for left, right in zip(whole.arrays, untouched.arrays, strict=True):
        changed |= (left != right).reshape(-1, 100).any(axis=0)
    assert np.flatnonzero(changed).tolist() == list(range(21, 61))


@every_fault
def test_fault_that_ends_before_it_starts_is_refused_in_one_line(part):
    for end_s in (10.0, 20.0):
        with pytest.raises(ValidationError) as caught:
            part(**(needed(part) | {"end_s": end_s}))
        assert first_fault(caught.value) == f"end_s must lie after start_s = 20, got {end_s:g}"


@every_inflow
def test_inflow_does_not_depend_on_block_lengths(part):
    inflow = part(**needed(part))
    whole = inflow.stream(np.random.default_rng(7)).take(4000)
    for lengths in ([1] * 50, [899, 900, 901], [0, 13, 0, 2000, 1]):
        stream = inflow.stream(np.random.default_rng(7))
        blocks = [stream.take(length) for length in [*lengths, 4000 - sum(lengths)]]
        assert np.concatenate(blocks).tobytes() == whole.tobytes()


@every_inflow
def test_inflow_is_finite_never_negative_and_a_function_of_its_seed(part):
    inflow = part(**needed(part))
    flow_m3h, again_m3h = (inflow.stream(np.random.default_rng(8)).take(20_000) for _ in range(2))
    assert flow_m3h.dtype == np.float64
    assert np.isfinite(flow_m3h).all()
    assert flow_m3h.min() >= 0
    assert flow_m3h.tobytes() == again_m3h.tobytes()


@pytest.mark.parametrize(
    ("table", "rule"),
    [
        ({"kind": "nope"}, "inflow: input tag 'nope'"),
        ({}, "inflow: unable to extract tag"),
        ({"kind": "empirical", "quantiles": [[0, 1]]}, "at least 2 items"),
        ({"kind": "empirical", "quantiles": [[0.1, 1], [1, 2]]}, "probabilities must rise from 0 to 1"),
        ({"kind": "empirical", "quantiles": [[0, 1], [0.5, 1], [0.5, 2], [1, 3]]}, "probabilities must rise"),
        ({"kind": "empirical", "quantiles": [[0, 2], [1, 1]]}, "flows must not fall"),
        ({"kind": "empirical", "quantiles": [[0, -1], [1, 1]]}, "got -1"),
        ({"kind": "empirical", "surges": {"duration_s": 0}}, "surges.duration_s: got 0"),
        ({"kind": "diurnal", "period_s": 0}, "period_s: got 0"),
        ({"kind": "recorded", "time_s": [], "flow_m3h": []}, "at least one"),
        ({"kind": "recorded", "time_s": [0, 1], "flow_m3h": [1]}, "as many times as flows"),
        ({"kind": "recorded", "time_s": [[0, 1]], "flow_m3h": [[1, 1]]}, "as many times as flows"),
        ({"kind": "recorded", "time_s": [1, 2], "flow_m3h": [1, 1]}, "time_s must rise from 0"),
        ({"kind": "recorded", "time_s": [0, 2, 1], "flow_m3h": [1, 1, 1]}, "time_s must rise from 0"),
        ({"kind": "recorded", "time_s": [0, float("nan")], "flow_m3h": [1, 1]}, "time_s must rise from 0"),
        ({"kind": "recorded", "time_s": [0, float("inf")], "flow_m3h": [1, 1]}, "finite"),
        ({"kind": "recorded", "time_s": [0, 1], "flow_m3h": [1, -1]}, "not negative"),
        ({"kind": "recorded", "time_s": [0, 1], "flow_m3h": [1, float("nan")]}, "finite"),
        ({"kind": "recorded", "time_s": {"a": 1}, "flow_m3h": [1, 1]}, "must be an array of numbers"),
        ({"kind": "recorded", "time_s": "soon", "flow_m3h": [1, 1]}, "time_s"),
    ],
)
def test_bad_inflows_are_refused_in_one_line(table, rule):
    with pytest.raises(ValidationError) as caught:
        Scenario.model_validate({"name": "bad", "inflow": table})
    line = first_fault(caught.value)
    assert "\n" not in line
    assert rule in line


@pytest.mark.parametrize(
    ("table", "rule"),
    [
        ({"kind": "nope"}, "fault[1]: input tag 'nope'"),
        ({"kind": "blockage", "start_s": 0, "end_s": 1}, "pump: missing"),
        ({"kind": "blockage", "pump": 0, "start_s": 0, "end_s": 1}, "pump: got 0"),
        ({"kind": "blockage", "pump": 1, "start_s": -1, "end_s": 1}, "start_s: got -1"),
        ({"kind": "blockage", "pump": 1, "start_s": 0, "end_s": 1, "speed_loss": 1}, "speed_loss: got 1"),
        ({"kind": "blockage", "pump": 1, "start_s": 0, "end_s": 1, "after": "stay"}, "after: got 'stay'"),
        ({"kind": "pipe_clogging", "start_s": 0, "end_s": float("inf")}, "end_s: got inf"),
        ({"kind": "pipe_clogging", "start_s": 0, "end_s": 1, "friction_rise": -0.1}, "friction_rise: got -0.1"),
    ],
)
def test_bad_faults_are_refused_in_one_line(table, rule):
    with pytest.raises(ValidationError) as caught:
        Scenario.model_validate({"name": "bad", "fault": [table]})
    line = first_fault(caught.value)
    assert "\n" not in line
    assert rule in line
