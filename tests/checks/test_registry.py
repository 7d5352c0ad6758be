"""What holds for every registered fault and inflow, so that a new one is checked without a test of its own."""

import json
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from pydantic import ValidationError

from wetwell.protocols.errors import first_fault
from wetwell.protocols.quantities import FIRST_PUMP
from wetwell.protocols.station.station_file import load_toml
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.faults.profile import Profile, PumpFault, SensorFault, SystemFault
from wetwell.simulator.forcing import healthy_forcing
from wetwell.simulator.inflow import INFLOWS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.telemetry.channels import channels

REGISTERED = [*FAULTS.items(), *INFLOWS.items()]
NEEDED = {
    "pump": 2,
    "start_s": 20.0,
    "end_s": 60.0,
    "channel": "flow_m3h",
    "bias": 3.0,
    "bias_per_hour": 90.0,
    "time_s": [0.0, 30.0, 45.0],
    "flow_m3h": [3.0, 0.0, 1e-7],
}
DOCS = Path(__file__).parents[2] / "docs"
EXPLAINED = {"recorded"}
"""Parts that are a lookup, not an equation."""

every_part = pytest.mark.parametrize(("kind", "part"), REGISTERED, ids=[kind for kind, _ in REGISTERED])
every_fault = pytest.mark.parametrize("part", FAULTS.values(), ids=FAULTS)
every_inflow = pytest.mark.parametrize("part", INFLOWS.values(), ids=INFLOWS)


def needed(part):
    return {name: NEEDED[name] for name, field in part.model_fields.items() if field.is_required()}


def three_pumps():
    """Forcing of a station with one main, in health."""
    return healthy_forcing(np.linspace(0, 50, 100), pumps=3, mains=1, with_sensors=True)


def in_toml(value):
    """TOML text of a value; tables become inline tables."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {in_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(in_toml, value)) + "]"
    return json.dumps(value)


def test_registries_are_not_empty():
    pump_faults = {"blockage", "impeller_wear", "wear_ring_leakage", "ragging", "check_valve_leak", "drive_trip"}
    system_faults = {"pipe_clogging", "partly_closed_valve", "air_pocket"}
    sensor_faults = {"sensor_stuck", "sensor_drift", "sensor_bias", "sensor_noise", "frozen_plc"}
    assert set(FAULTS) == pump_faults | system_faults | sensor_faults
    assert set(INFLOWS) == {"empirical", "diurnal", "recorded", "catchment"}


@every_part
def test_kind_is_the_registry_key(kind, part):
    assert part(**needed(part)).kind == kind


def rows_of(page):
    """Rows of the tables of a page whose first cell is a name."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line.startswith("| `") and line.count("|") >= 4]


@every_part
def test_docs_have_a_row_that_names_every_parameter(kind, part):
    (row,) = [line for line in rows_of("faults.md" if kind in FAULTS else "inflows.md") if f"| `{kind}` |" in line]
    for name in set(part.model_fields) - set(Profile.model_fields) - {"kind"}:
        assert f"`{name}`" in row
    if kind in FAULTS:
        concerns = "pump" if issubclass(part, PumpFault) else "system" if issubclass(part, SystemFault) else "sensor"
        assert f"| {concerns} |" in row
    for name, field in part.model_fields.items():
        if isinstance(field.default, int | float) and name not in {"pump", "duty"}:
            inherited = Profile.model_fields.get(name)
            if inherited is None or inherited.default != field.default:
                assert f"{field.default:g}" in row, f"{kind}: default of {name} is not {field.default:g} in the docs"


@pytest.mark.parametrize(("page", "registry"), [("faults.md", FAULTS), ("inflows.md", INFLOWS)])
def test_docs_name_no_kind_that_is_not_registered(page, registry):
    common = {"start_s", "after", "shape", "period_s"}
    assert {row.split("`")[1] for row in rows_of(page)} - common == set(registry)


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
    for name in set(part.model_fields) - set(Profile.model_fields) - {"kind", "pump"}:
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


def have_same_bytes(one, other):
    return [np.asarray(array).tobytes() for array in one] == [np.asarray(array).tobytes() for array in other]


@every_fault
def test_fault_of_zero_strength_is_identity(part):
    assert set(part.neutral) <= set(part.model_fields)
    nothing = part(**(needed(part) | part.neutral))
    forcing, untouched = (three_pumps() for _ in range(2))
    nothing.apply(forcing, np.arange(100.0))
    assert have_same_bytes(forcing, untouched)


def part_of(forcing, first, last):
    """Views of some of the seconds of a forcing."""
    return type(forcing)(*(part[..., first:last] if isinstance(part, np.ndarray) else part for part in forcing))


SHAPED = [
    pytest.param(part, shape, after, id=f"{kind}-{shape}-{after}")
    for kind, part in FAULTS.items()
    for shape in get_args(part.model_fields["shape"].annotation)
    for after in ("hold", "clear")
]


@pytest.mark.parametrize(("part", "shape", "after"), SHAPED)
def test_fault_acts_only_in_its_time_and_in_any_blocks(part, shape, after):
    fault = part(**(needed(part) | {"shape": shape, "after": after, "period_s": 7.0, "duty": 0.4}))
    time_s = np.arange(100.0)
    whole, parts, untouched = (three_pumps() for _ in range(3))
    fault.apply(whole, time_s)
    for first, last in ((0, 1), (1, 37), (37, 37), (37, 100)):
        fault.apply(part_of(parts, first, last), time_s[first:last])
    assert have_same_bytes(whole, parts)
    changed = np.zeros(100, dtype=bool)
    for left, right in zip(whole, untouched, strict=True):
        if isinstance(left, np.ndarray):
            changed |= (left != right).reshape(-1, 100).any(axis=0)
    acts = {
        "ramp": range(21, 100),
        "step": range(20, 100),
        "intermittent": [second for second in range(20, 100) if (second - 20) % 7 < 0.4 * 7],
    }[shape]
    assert np.flatnonzero(changed).tolist() == [second for second in acts if after == "hold" or second <= 60]


@every_fault
def test_fault_concerns_its_pump_only(part):
    """Of pump arrays and pump channels; a fault of the whole station has no pump."""
    if "pump" not in part.model_fields:
        assert issubclass(part, SystemFault | SensorFault)
        return
    forcing, untouched = (three_pumps() for _ in range(2))
    part(**(needed(part) | {"pump": 2})).apply(forcing, np.arange(100.0))
    for left, right in zip(forcing, untouched, strict=True):
        if np.shape(left) == (3, 100):
            assert (left[[0, 2]] == right[[0, 2]]).all()
        elif np.shape(left) == (channels(3), 100):
            for i in (0, 2):
                rows = slice(FIRST_PUMP + 4 * i, FIRST_PUMP + 4 * i + 4)
                assert (left[rows] == right[rows]).all()
        else:
            assert np.all(left == right)


@every_fault
def test_fault_that_ends_before_it_starts_is_refused_in_one_line(part):
    for end_s in (10.0, 20.0):
        with pytest.raises(ValidationError) as caught:
            part(**(needed(part) | {"end_s": end_s}))
        assert first_fault(caught.value) == f"end_s must lie after start_s = 20, got {end_s:g}"


@every_inflow
def test_inflow_does_not_depend_on_block_lengths(part):
    inflow = part(**needed(part))
    whole = inflow.stream(np.random.default_rng(7)).next_seconds(4000)
    for lengths in ([1] * 50, [899, 900, 901], [0, 13, 0, 2000, 1]):
        stream = inflow.stream(np.random.default_rng(7))
        blocks = [stream.next_seconds(length) for length in [*lengths, 4000 - sum(lengths)]]
        assert np.concatenate(blocks).tobytes() == whole.tobytes()


@every_inflow
def test_inflow_is_finite_never_negative_and_a_function_of_its_seed(part):
    inflow = part(**needed(part))
    flow_m3h, again_m3h = (inflow.stream(np.random.default_rng(8)).next_seconds(20_000) for _ in range(2))
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
        ({"kind": "catchment", "hours": [1.0] * 23}, "at least 24 items"),
        ({"kind": "catchment", "hours": [0.0] * 24}, "hours: at least one must be above 0"),
        ({"kind": "catchment", "first_weekday": 0}, "first_weekday: got 0"),
        ({"kind": "catchment", "storm_shape": 0.5}, "storm_shape: got 0.5"),
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
        ({"kind": "pipe_clogging", "start_s": 0, "end_s": 1, "shape": "saw"}, "shape: got 'saw'"),
        ({"kind": "pipe_clogging", "start_s": 0, "end_s": 1, "period_s": 0}, "period_s: got 0"),
        ({"kind": "pipe_clogging", "start_s": 0, "end_s": 1, "duty": 1.1}, "duty: got 1.1"),
        ({"kind": "partly_closed_valve", "start_s": 0, "end_s": 1, "opening": 0}, "opening: got 0"),
        ({"kind": "frozen_plc", "start_s": 0, "end_s": 1, "shape": "ramp"}, "shape: got 'ramp'"),
        ({"kind": "sensor_bias", "start_s": 0, "end_s": 1, "channel": "flow_m3h"}, "bias: missing"),
        ({"kind": "sensor_stuck", "start_s": 0, "end_s": 1, "channel": "frequency_hz"}, "channel: got 'freq"),
        (
            {"kind": "sensor_stuck", "start_s": 0, "end_s": 1, "channel": "level_m", "pump": 1},
            "pump must be 0 for channel 'level_m' of the station, got 1",
        ),
        ({"kind": "pipe_clogging", "start_s": 0, "end_s": 1, "friction_rise": -1.0}, "friction_rise: got -1"),
    ],
)
def test_bad_faults_are_refused_in_one_line(table, rule):
    with pytest.raises(ValidationError) as caught:
        Scenario.model_validate({"name": "bad", "fault": [table]})
    line = first_fault(caught.value)
    assert "\n" not in line
    assert rule in line
