"""Cases of a trial whose deviations do not matter are drawn anew."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.errors import WetwellError
from wetwell.protocols.recordings.recording import read_recording
from wetwell.protocols.station.station_file import load_station
from wetwell.services.trial import run
from wetwell.services.trial.material_case import ATTEMPTS, immaterial_name, material_case
from wetwell.services.trial.plan import TrialPlan
from wetwell.services.trial.plants import passage_of
from wetwell.services.trial.sealed_case import open_case, publish
from wetwell.services.trial.swmm_plant import SolutionLostError
from wetwell.sim2real.trial.cases import KINDS, StoragePlan, TrialCase, trial_case
from wetwell.sim2real.trial.materiality import moved
from wetwell.sim2real.trial.readings import readings_of
from wetwell.sim2real.truth.case import Deviation
from wetwell.sim2real.truth.storage import Storage

FAKE = (sys.executable, str(Path(__file__).with_name("fake_diagnoser.py")))
PLAN = TrialPlan(seed=1, count=2, kinds=("single",), seconds=7200, command=FAKE, effects=("report_by_exception",))
"""Both cases are a deadband; that of case 1 is too small to matter in the first attempt."""


def quiet_truth(plant="fine", seconds=14_400):
    return trial_case(9, 0, kinds=("none",), plants=(plant,), seconds=seconds).truth()


def deviating(truth, *deviations):
    return replace(truth, deviations=tuple(Deviation(name=name, parameters=p) for name, p in deviations))


@pytest.mark.check
def test_the_first_attempt_is_what_it_was_before_there_were_others():
    drawn = [trial_case(3, k, kinds=KINDS, plants=("fine", "swmm"), seconds=600) for k in range(5)]
    assert [(case.kind, case.plant, case.names) for case in drawn] == [
        ("single", "fine", ("flow_meter_gain",)),
        ("pair", "fine", ("level_quantisation", "threshold_shift")),
        ("none", "fine", ()),
        ("open", "fine", ("head_sensor_scale",)),
        ("leave_one_out", "fine", ("pump_wear",)),
    ]
    truths = [case.truth() for case in drawn]
    assert [(truth.station.name, truth.seed) for truth in truths] == [  # the name is drawn first, the seed last
        ("station-a21df0", 1376126276),
        ("station-19af9f", 959829136),
        ("station-e1e669", 1221850488),
        ("station-870375", 684429724),
        ("station-d3f301", 631286645),
    ]


def test_another_attempt_has_the_same_names_and_another_station():
    case = trial_case(3, 1, kinds=KINDS, plants=("fine",), seconds=600)
    truths = [replace(case, attempt=attempt).truth() for attempt in (0, 1, 2, 1)]
    assert all(tuple(deviation.name for deviation in truth.deviations) == case.names for truth in truths)
    assert len({truth.station.name for truth in truths}) == len({truth.seed for truth in truths}) == 3
    assert truths[1] == truths[3]


@pytest.mark.parametrize(
    ("name", "under", "over"),
    [
        ("check_valve_leak", {"leak_m3h": 0.02}, {"leak_m3h": 1.5}),
        ("flow_low_cutoff", {"cutoff_m3h": 1e-3}, {"cutoff_m3h": 150.0}),
        ("static_head_bias", {"offset_m": 0.05}, {"offset_m": 1.0}),
        ("threshold_shift", {"start_m": 0.004, "stop_m": 0.0}, {"start_m": 0.03, "stop_m": 0.0}),
        ("level_quantisation", {"quantum_m": 0.004}, {"quantum_m": 0.03}),
        ("channel_delay", {"channel": "flow_m3h", "delay_s": 0.2}, {"channel": "flow_m3h", "delay_s": 3.0}),
        ("power_meter_drift", {"drift": 0.01}, {"drift": 0.1}),
    ],
)
def test_a_deviation_under_the_size_that_matters_is_found_beside_one_over_it(name, under, over):
    gain = ("head_sensor_offset", {"offset_m": 2.0})
    assert immaterial_name(deviating(quiet_truth(), gain, (name, under)), "fine") == name
    assert immaterial_name(deviating(quiet_truth(), gain, (name, over)), "fine") == ""


@pytest.mark.parametrize("plant", ["fine", pytest.param("elastic", marks=pytest.mark.long)])
def test_a_station_that_starts_fuller_is_no_other_station(plant):
    truth = quiet_truth(plant, seconds=43_200)
    fuller = replace(truth, initial_level_m=truth.initial_level_m + 0.1)
    readings, others = (readings_of(passage_of(one, plant).oracle(), one.station) for one in (truth, fuller))
    assert not np.array_equal(readings.value[:1000], others.value[:1000])
    assert moved(readings, others) < 0.7


def test_what_is_not_stored_does_not_count():
    truth = deviating(quiet_truth(), ("flow_meter_gain", {"factor": 1.1}))
    assert immaterial_name(truth, "fine") == ""
    assert immaterial_name(replace(truth, storage=Storage(absent=("head_m", "inflow_m3h"))), "fine") == ""
    assert immaterial_name(replace(truth, storage=Storage(absent=("flow_m3h",))), "fine") == "flow_meter_gain"


def test_friction_shows_in_the_balance_where_no_flow_is_stored():
    truth = replace(quiet_truth(), storage=Storage(absent=("flow_m3h", "head_m", "power_kw")))
    assert immaterial_name(deviating(truth, ("friction_bias", {"factor": 1.6, "smoothness": 0.0})), "fine") == ""


def test_sizes_are_those_of_the_station_file():
    truth = deviating(quiet_truth(), ("head_sensor_offset", {"offset_m": 1.5}))
    assert immaterial_name(truth, "fine") == ""
    lenient = truth.station.materiality.model_copy(update={"head_share": 0.2})
    station = truth.station.model_copy(update={"materiality": lenient})
    assert immaterial_name(replace(truth, station=station), "fine") == "head_sensor_offset"


def test_pumps_of_a_common_header_that_never_run_together_are_found():
    case = TrialCase(seed=1, number=0, kind="single", plant="fine", names=("common_header",), seconds=900)
    truth = case.truth()
    recording = passage_of(truth, "fine").recording(truth=False)
    running = sum(values for name, values in recording.columns.items() if name.endswith("_running"))
    assert np.max(running) == 1.0
    assert immaterial_name(truth, "fine") == "common_header"


def test_a_case_whose_deviation_does_not_matter_is_drawn_anew(tmp_path):
    first = PLAN.case(1)
    assert immaterial_name(first.truth(), "fine") == "report_by_exception"
    publish(first, tmp_path)
    label = open_case(first.name, tmp_path)
    assert (label.attempt, label.names) == (1, first.names)
    truth = replace(first, attempt=1).truth()
    assert label.parameters == {"report_by_exception": truth.deviations[0].parameters}
    assert load_station(tmp_path / "published/case-0001/station.toml") == truth.station
    recording = read_recording(tmp_path / "published/case-0001/recording.parquet")
    made = passage_of(truth, "fine").recording(truth=False)
    assert all(np.array_equal(values, made.column(name)) for name, values in recording.columns.items())
    assert immaterial_name(truth, "fine") == ""


def test_a_case_whose_pumps_run_the_wet_well_dry_is_drawn_anew():
    """The true plant goes on, a simulator does not: no two models say what pumps take of an empty wet well."""
    first = TrialCase(seed=6, number=0, kind="single", plant="elastic", names=("control_delay",), seconds=3600)
    assert passage_of(first.truth(), "elastic").lowest_level_m == 0.0
    assert immaterial_name(first.truth(), "elastic") == ""
    case, truth, _ = material_case(first)
    assert case.attempt > 0
    assert passage_of(truth, "elastic").lowest_level_m > 0.05


@pytest.mark.long
def test_a_case_in_which_swmm_loses_the_solution_is_drawn_anew():
    """Its pumps carry twice their duty above their shut-off head there: the iteration swings between two steps."""
    pytest.importorskip("pyswmm", exc_type=ImportError)
    first = trial_case(8623, 0, kinds=("pair",), plants=("swmm",), seconds=14_400, storage=StoragePlan(rates_s=(1,)))
    with pytest.raises(SolutionLostError, match=r"lost the solution: in steady running a head is off by \d\.\d\d of"):
        passage_of(first.truth(), "swmm")
    case, truth, _ = material_case(first)
    assert case.attempt > 0
    passage_of(truth, "swmm")


def test_a_case_whose_deviation_matters_stays_in_its_first_attempt():
    first = PLAN.case(0)
    case, truth, recording = material_case(first)
    assert (case, truth) == (first, first.truth())
    made = passage_of(truth, "fine").recording(truth=False)
    assert all(np.array_equal(values, recording.column(name)) for name, values in made.columns.items())


def test_what_needs_the_truth_later_gets_the_published_attempt(tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_MODE", "none")
    monkeypatch.setenv("FAKE_FOLDER", str(tmp_path))
    held_out = []
    monkeypatch.setattr(run, "measure_holdout", lambda case, *_: held_out.append(case))
    run.run_trial(replace(PLAN, replay=("replay",)), tmp_path, workers=1)
    assert [case.attempt for case in held_out] == [0, 1]
    for case in held_out:
        assert case.truth().station == load_station(tmp_path / "published" / case.name / "station.toml")


@pytest.mark.long
def test_a_case_that_matters_in_no_attempt_fails_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_MODE", "none")
    monkeypatch.setenv("FAKE_FOLDER", str(tmp_path))
    plan = replace(PLAN, seconds=20, kinds=("single", "none"))
    result = run.run_trial(plan, tmp_path, workers=1)
    line = (
        f"case-0000: none of {ATTEMPTS} draws stands for reality; in the last one 'report_by_exception' moves "
        "nothing that plant 'fine' records by more than is material: a longer recording may show it"
    )
    assert result["failed"] == [{"case": "case-0000", "error": line}]
    assert result["all"]["cases"] == 1
    assert [path.name for path in (tmp_path / "sealed").iterdir()] == ["case-0001.json"]
    assert not (tmp_path / "published/case-0000").exists()
    again = run.run_trial(plan, tmp_path, workers=1)
    assert again | {"date": ""} == result | {"date": ""}


def test_a_case_without_deviations_has_nothing_to_matter():
    quiet = TrialCase(seed=1, number=0, kind="none", plant="fine", names=(), seconds=20)
    assert material_case(quiet)[0].attempt == 0
    with pytest.raises(WetwellError, match="'friction_bias' moves nothing"):
        material_case(replace(quiet, kind="single", names=("friction_bias",)))
