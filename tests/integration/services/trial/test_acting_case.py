"""Cases of a trial whose deviations never act are drawn anew."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.errors import WetwellError
from wetwell.protocols.recordings.recording import read_recording
from wetwell.protocols.station.station_file import load_station
from wetwell.services.trial import run
from wetwell.services.trial.acting_case import ATTEMPTS, acting_case, idle_name, recording_of
from wetwell.services.trial.plan import TrialPlan
from wetwell.services.trial.sealed_case import open_case, publish
from wetwell.sim2real.trial.cases import KINDS, TrialCase, trial_case
from wetwell.sim2real.truth.case import Deviation

FAKE = (sys.executable, str(Path(__file__).with_name("fake_diagnoser.py")))
PLAN = TrialPlan(seed=84, count=2, kinds=("single",), seconds=300, command=FAKE)
"""Of 300 seconds, in which a pump may not start: case 0 is a low cutoff of the flow, and acts in attempt 2."""


def test_the_first_attempt_is_what_it_was_before_there_were_others():
    drawn = [trial_case(3, k, kinds=KINDS, plants=("fine", "swmm"), seconds=600) for k in range(5)]
    assert [(case.kind, case.plant, case.names) for case in drawn] == [
        ("single", "fine", ("load_dependent_power",)),
        ("pair", "fine", ("threshold_shift", "level_quantisation")),
        ("none", "fine", ()),
        ("open", "fine", ("sticking_check_valve",)),
        ("leave_one_out", "fine", ("flow_meter_gain",)),
    ]
    truths = [case.truth() for case in drawn]
    assert [(truth.station.name, truth.seed) for truth in truths] == [  # the name is drawn first, the seed last
        ("station-a21df0", 1376126276),
        ("station-19af9f", 321134274),
        ("station-e1e669", 1221850488),
        ("station-870375", 684429724),
        ("station-d3f301", 605003381),
    ]


def test_another_attempt_has_the_same_names_and_another_station():
    case = trial_case(3, 1, kinds=KINDS, plants=("fine",), seconds=600)
    truths = [replace(case, attempt=attempt).truth() for attempt in (0, 1, 2, 1)]
    assert all(tuple(deviation.name for deviation in truth.deviations) == case.names for truth in truths)
    assert len({truth.station.name for truth in truths}) == len({truth.seed for truth in truths}) == 3
    assert truths[1] == truths[3]


@pytest.mark.parametrize(("cutoff_m3h", "idle"), [(1e-3, "flow_low_cutoff"), (60.0, "")])
def test_a_deviation_that_never_acts_is_found_beside_one_that_does(cutoff_m3h, idle):
    truth = trial_case(9, 0, kinds=("none",), plants=("fine",), seconds=7200).truth()
    cutoff = Deviation(name="flow_low_cutoff", parameters={"cutoff_m3h": cutoff_m3h})
    gain = Deviation(name="flow_meter_gain", parameters={"factor": 1.1})
    truth = replace(truth, deviations=(gain, cutoff))
    assert idle_name(truth, "fine", recording_of(truth, "fine")) == idle


def test_pumps_of_a_common_header_that_never_run_together_are_found():
    case = TrialCase(seed=1, number=0, kind="single", plant="fine", names=("common_header",), seconds=900)
    truth = case.truth()
    recording = recording_of(truth, "fine")
    running = sum(values for name, values in recording.columns.items() if name.endswith("_running"))
    assert np.max(running) == 1.0
    assert idle_name(truth, "fine", recording) == "common_header"


def test_a_case_whose_deviation_never_acts_is_drawn_anew(tmp_path):
    first = PLAN.case(0)
    truth = first.truth()
    assert idle_name(truth, "fine", recording_of(truth, "fine")) == "flow_low_cutoff"
    publish(first, tmp_path)
    label = open_case(first.name, tmp_path)
    assert (label.attempt, label.names) == (2, first.names)
    truth = replace(first, attempt=2).truth()
    assert label.parameters == {"flow_low_cutoff": truth.deviations[0].parameters}
    assert load_station(tmp_path / "published/case-0000/station.toml") == truth.station
    recording = read_recording(tmp_path / "published/case-0000/recording.parquet")
    assert idle_name(truth, "fine", recording) == ""


def test_what_needs_the_truth_later_gets_the_published_attempt(tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_MODE", "none")
    monkeypatch.setenv("FAKE_FOLDER", str(tmp_path))
    held_out = []
    monkeypatch.setattr(run, "measure_holdout", lambda case, *_: held_out.append(case))
    run.run_trial(replace(PLAN, replay=("replay",)), tmp_path, workers=1)
    assert [case.attempt for case in held_out] == [2, 0]
    for case in held_out:
        assert case.truth().station == load_station(tmp_path / "published" / case.name / "station.toml")


def test_a_case_that_acts_in_no_attempt_fails_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_MODE", "none")
    monkeypatch.setenv("FAKE_FOLDER", str(tmp_path))
    result = run.run_trial(replace(PLAN, seconds=10), tmp_path, workers=1)
    line = (
        f"case-0000: 'flow_low_cutoff' changes no recorded value of plant 'fine' in any of {ATTEMPTS} draws: "
        "a longer recording may show it"
    )
    assert result["failed"] == [{"case": "case-0000", "error": line}]
    assert result["all"]["cases"] == 1
    assert [path.name for path in (tmp_path / "sealed").iterdir()] == ["case-0001.json"]
    assert not (tmp_path / "published/case-0000").exists()
    again = run.run_trial(replace(PLAN, seconds=10), tmp_path, workers=1)
    assert again | {"date": ""} == result | {"date": ""}


def test_only_kinds_that_may_never_act_are_looked_at():
    quiet = TrialCase(seed=1, number=0, kind="single", plant="fine", names=("friction_bias",), seconds=10)
    assert acting_case(quiet)[0].attempt == 0
    with pytest.raises(WetwellError, match="'common_header' changes no recorded value"):
        acting_case(replace(quiet, names=("common_header",)))
