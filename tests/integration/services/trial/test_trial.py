"""A small trial end to end, with diagnosers whose scores are known before."""

import hashlib
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.errors import ConfigError, RecordingError, WetwellError
from wetwell.protocols.recordings.recording import read_recording
from wetwell.protocols.station.station_file import load_station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.trial.diagnosis import RECALIBRATION
from wetwell.services.trial.families import families_table
from wetwell.services.trial.plan import TrialPlan
from wetwell.services.trial.run import run_trial
from wetwell.services.trial.sealed_case import publish
from wetwell.services.trial.swmm_plant import run_swmm
from wetwell.sim2real.trial.cases import KINDS, StoragePlan, trial_case
from wetwell.sim2real.trial.families import FAMILIES
from wetwell.sim2real.truth.case import Deviation, TruthCase

FAKE = (sys.executable, str(Path(__file__).with_name("fake_diagnoser.py")))
COUNT = 12
SECONDS = 14_400
"""In which pumps run together more than once: a common header has to matter."""


def run_fake(mode, folder, monkeypatch, **changes):
    monkeypatch.setenv("FAKE_MODE", mode)
    monkeypatch.setenv("FAKE_FOLDER", str(folder))
    plan = TrialPlan(**{"seed": 3, "count": COUNT, "seconds": SECONDS, "command": FAKE} | changes)
    return plan, run_trial(plan, folder, workers=1)


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """Folder of published cases."""
    folder = tmp_path_factory.mktemp("trial")
    plan = TrialPlan(seed=3, count=COUNT, seconds=SECONDS)
    for number in range(COUNT):
        publish(plan.case(number), folder)
    return folder


@pytest.fixture
def folder(cases, tmp_path):
    """A copy of them for one test."""
    shutil.copytree(cases, tmp_path / "trial")
    return tmp_path / "trial"


def test_a_perfect_diagnosis_scores_one(folder, monkeypatch):
    _, result = run_fake("perfect", folder, monkeypatch)
    names = ("verdict_right", "exact_set", "exact_by_name", "top_1", "top_2", "component_right", "interval_coverage")
    for name in names:
        assert result["all"][name]["value"] == 1.0, name
    assert result["all"]["equivalents"]["mean"] == 0.0
    assert result["reliability"]["all"] == {
        "cases": COUNT,
        "calibration_error": 0.0,
        "chance": 0.0,
        "brier": 0.0,
        "bins": [{"from": 0.95, "to": 1.0, "cases": COUNT, "said": 1.0, "right": 1.0}],
    }
    assert result["all"]["false_attribution"]["value"] == 0.0
    assert result["all"]["shrinkage"] == {"median": 1.0, "mean": 1.0}
    assert result["all"]["parameter_error"]["median"] == 0.0
    assert result["all"]["failed"] == 0
    assert {kind: scores["cases"] for kind, scores in result["kinds_scored"].items()} == dict.fromkeys(KINDS, 2)
    assert result["controls"]["permuted_labels"]["verdict_right"] < 0.6
    page = (folder / "trial.html").read_text()
    assert "<script" not in page
    assert "Truth against answer" in page
    assert len(json.loads((folder / "trial.json").read_text())["cases"]) == COUNT


@pytest.mark.long
def test_the_real_diagnosis_names_a_sealed_effect_and_is_silent_without_one(tmp_path):
    effect = "static_head_bias"
    plan = TrialPlan(seed=26, count=2, kinds=("single", "none"), seconds=14_400, effects=(effect,))
    result = run_trial(plan, tmp_path, workers=1)
    single, none = (plan.case(number).name for number in range(2))
    reports = {name: json.loads((tmp_path / "reports" / name / "report.json").read_text()) for name in (single, none)}
    assert [reports[name]["verdict"] for name in (single, none)] == ["effect", "none"]
    assert reports[none]["effects"] == []
    assert result["all"]["failed"] == 0
    assert result["all"]["verdict_right"]["value"] == 1.0
    assert result["all"]["top_2"]["value"] == 1.0
    assert result["all"]["component_right"]["value"] == 1.0
    for name in (single, none):
        sealed = (tmp_path / "sealed" / f"{name}.json").read_bytes()
        seal = (tmp_path / "published" / name / "seal.sha256").read_text().strip()
        assert seal == hashlib.sha256(sealed).hexdigest()
    assert json.loads((tmp_path / "sealed" / f"{single}.json").read_text())["names"] == [effect]


def test_always_none_scores_what_it_deserves(folder, monkeypatch):
    _, result = run_fake("none", folder, monkeypatch)
    assert result["all"]["verdict_right"]["value"] == pytest.approx(1 / 6)
    assert result["kinds_scored"]["none"]["verdict_right"]["value"] == 1.0
    assert result["all"]["top_1"]["value"] == 0.0
    assert result["all"]["component_right"]["value"] == 0.0
    assert result["all"]["false_attribution"]["value"] == 0.0
    assert result["all"]["shrinkage"]["mean"] == 0.0
    assert result["confusion"]["columns"] == ["none"]
    assert result["controls"]["permuted_labels"]["verdict_right"] == pytest.approx(1 / 6)


@pytest.mark.parametrize(("mode", "said"), [("broken", "exit code 1: cannot do it"), ("garbage", "is not JSON")])
def test_a_diagnosis_that_fails_is_wrong_and_its_reason_is_kept(mode, said, folder, monkeypatch):
    _, result = run_fake(mode, folder, monkeypatch)
    assert result["all"]["failed"] == COUNT
    assert result["all"]["verdict_right"]["value"] == 0.0
    assert said in (folder / "reports" / "case-0000" / "failure.txt").read_text()


def test_the_diagnosis_gets_two_files_without_truth_and_the_missing_effect_only(folder, monkeypatch):
    plan, _ = run_fake("perfect", folder, monkeypatch, has_recalibration=True)
    spied = [json.loads(line) for line in (folder / "spy.jsonl").read_text().splitlines()]
    assert all(seen["files"] == ["recording.parquet", "station.toml"] for seen in spied)
    held_out = sorted(name for number in range(COUNT) for name in plan.case(number).without)
    assert sorted(name for seen in spied for name in seen["without"]) == held_out
    assert len(held_out) == 2
    assert sum(seen["only"] == list(RECALIBRATION) for seen in spied) == 6
    for number in range(COUNT):
        published = folder / "published" / f"case-{number:04}"
        assert {path.name for path in published.iterdir()} == {"station.toml", "recording.parquet", "seal.sha256"}
        recording = read_recording(published / "recording.parquet")
        assert recording.truth == {}
        assert recording.ignored == ()
        station = load_station(published / "station.toml")
        assert station.effect == ()
        assert recording.station == station.name


@pytest.mark.parametrize("changed", ["sealed/case-0001.json", "published/case-0001/recording.parquet"])
def test_what_was_changed_after_sealing_is_refused(changed, folder, monkeypatch):
    path = folder / changed
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=rf"{changed}: is not what was sealed"):
        run_fake("none", folder, monkeypatch)
    assert not (folder / "trial.json").exists()


def test_salts_differ_and_cases_do_not_depend_on_their_number(folder, tmp_path):
    plan = TrialPlan(seed=3, count=2, seconds=SECONDS)
    publish(plan.case(1), tmp_path / "again")
    one, other = (json.loads((path / "sealed/case-0001.json").read_text()) for path in (folder, tmp_path / "again"))
    assert one["salt"] != other["salt"]
    assert one["sha256"] == other["sha256"]
    assert one["parameters"] == other["parameters"]


def test_a_second_run_resumes_and_another_plan_is_refused(folder, monkeypatch):
    plan, first = run_fake("perfect", folder, monkeypatch)
    runs = len((folder / "spy.jsonl").read_text().splitlines())
    again = run_trial(plan, folder, workers=1)
    assert again | {"date": ""} == first | {"date": ""}
    assert len((folder / "spy.jsonl").read_text().splitlines()) == runs == COUNT
    with pytest.raises(ConfigError, match="holds a trial with another seed"):
        run_fake("perfect", folder, monkeypatch, seed=4)
    with pytest.raises(ConfigError, match="holds a trial with another diagnoser"):
        run_fake("perfect", folder, monkeypatch, command=(*FAKE, "--only", "friction_bias"))


@pytest.mark.long
def test_shrinkage_on_unseen_recordings(folder, monkeypatch):
    replay = (sys.executable, str(Path(__file__).with_name("fake_replay.py")))
    _, result = run_fake("perfect", folder, monkeypatch, replay=replay)
    unseen = result["unseen"]
    assert unseen["cases"] == 6
    assert unseen["after"] == 0.0
    assert unseen["before"] > 2.0
    assert 0.5 < unseen["oracle"] < 1.5
    assert unseen["shrinkage"]["median"] > 1.0
    assert unseen["regressor"] < 0.7 * unseen["before"]
    assert "flexible regressor" in (folder / "trial.html").read_text()


def test_unseen_recordings_are_stored_as_the_case_is(tmp_path, monkeypatch):
    replay = (sys.executable, str(Path(__file__).with_name("fake_replay.py")))
    storage = StoragePlan(rates_s=(60,), values=("mean",), absent=("head_m", "inflow_m3h"))
    small = {"count": 1, "kinds": ("single",), "seconds": 14_400}
    _, result = run_fake("perfect", tmp_path, monkeypatch, replay=replay, storage=storage, **small)
    assert result["unseen"]["cases"] == 1
    assert result["unseen"]["before"] > result["unseen"]["oracle"] > 0.0


def test_a_controller_has_no_shrinkage_where_a_replay_is_given_what_it_does(tmp_path, monkeypatch):
    replay = (sys.executable, str(Path(__file__).with_name("fake_replay.py")))
    small = {"count": 1, "kinds": ("single",), "seconds": 14_400, "effects": ("control_delay",)}
    _, result = run_fake("perfect", tmp_path, monkeypatch, replay=replay, **small)
    assert result["unseen"]["cases"] == 1
    assert result["unseen"]["before"] > result["unseen"]["oracle"]
    assert result["unseen"]["shrinkage"] is None


def test_every_effect_takes_its_turn():
    held = len(FAMILIES["fine"].library)
    plan = TrialPlan(seed=5, count=2 * held, kinds=("single",), seconds=3600)
    names = [plan.case(number).names[0] for number in range(2 * held)]
    assert len(set(names[:held])) == held
    assert names[:held] == names[held:]
    other = TrialPlan(seed=6, count=held, kinds=("single",), seconds=3600)
    assert [other.case(number).names[0] for number in range(held)] != names[:held]


def test_rates_and_values_take_turns_with_the_same_effects_at_each():
    storage = StoragePlan(rates_s=(1, 60), values=("mean", "held"), absent=("head_m",))
    plan = TrialPlan(seed=5, count=80, kinds=("single",), seconds=3600, storage=storage)
    cases = [plan.case(number) for number in range(80)]
    assert [(case.every_s, case.value) for case in cases[:4]] == list(storage.ways)
    for first in range(0, 80, 4):
        assert len({case.names for case in cases[first : first + 4]}) == 1
    assert all("head_m" in case.absent for case in cases)
    assert 0.3 < np.mean(["inflow_m3h" in case.absent for case in cases]) < 0.7
    all_metered = replace(plan, storage=StoragePlan(metered_share=1.0))
    none_metered = replace(plan, storage=StoragePlan(absent=("inflow_m3h",), metered_share=1.0))
    assert {all_metered.case(number).absent for number in range(20)} == {()}
    assert {none_metered.case(number).absent for number in range(20)} == {("inflow_m3h",)}


BEHIND_THE_METER = {"unmetered_inflow", "second_sump", "storm_tank"}


@pytest.mark.parametrize("plants", [("fine", "swmm"), ("elastic",)])
def test_what_lies_behind_the_meter_of_the_inflow_is_asked_with_that_meter_alone(plants):
    some, none = (
        [
            trial_case(5, k, kinds=KINDS, plants=plants, seconds=600, storage=StoragePlan(metered_share=share))
            for k in range(300)
        ]
        for share in (0.5, 0.0)
    )
    behind = [case for case in some if BEHIND_THE_METER & {*case.names}]
    assert {"open", "leave_one_out", "single"} <= {case.kind for case in behind}
    assert not any(case.absent for case in behind)
    assert 0.3 < np.mean([bool(case.absent) for case in some]) < 0.7
    assert all(case.absent for case in none)
    assert not any(BEHIND_THE_METER & {*case.names[:1]} for case in none)
    assert {case.names[0] for case in none if case.names} < {case.names[0] for case in some if case.names}


def test_how_a_case_is_stored_is_its_own_and_the_same_in_all_attempts():
    plan = TrialPlan(seed=5, count=9, seconds=3600, storage=StoragePlan(rates_s=(60,), values=("held",)))
    cases = [plan.case(number) for number in range(9)]
    storages = [case.truth().storage for case in cases]
    assert len({bool(storage.step) for storage in storages}) == 2
    assert len({storage.report_s for storage in storages}) == 9
    again = replace(cases[0], attempt=1).truth()
    assert again.storage.report_s == storages[0].report_s
    assert again.station != cases[0].truth().station


def test_a_slow_trial_is_sealed_published_and_told_by_rate(tmp_path, monkeypatch):
    storage = StoragePlan(rates_s=(10, 60), values=("mean",), absent=("head_m",))
    shown = ("friction_bias", "flow_meter_gain", "threshold_shift", "pump_wear")
    plan, result = run_fake("perfect", tmp_path, monkeypatch, seed=4, storage=storage, seconds=7200, effects=shown)
    assert list(result["splits"]["rate"]) == ["10 s mean", "60 s mean"]
    for name in ("rate", "inflow", "noise"):
        groups = result["splits"][name].values()
        assert sum(group["scores"]["cases"] for group in groups) == COUNT
        assert sum(np.sum(group["confusion"]["counts"]) for group in groups) == COUNT
    page = (tmp_path / "trial.html").read_text()
    assert "By rate" in page
    assert "60 s mean" in page
    for number in range(COUNT):
        case = plan.case(number)
        published = tmp_path / "published" / case.name
        recording, station = read_recording(published / "recording.parquet"), load_station(published / "station.toml")
        assert (recording.station, recording.value) == (station.name, "mean")
        assert set(np.diff(recording.time_ns)) == {case.every_s * NS_PER_S}
        assert not any(name.endswith("head_m") for name in recording.columns)
        assert ("inflow_m3h" in recording.columns) == ("inflow_m3h" not in case.absent)
        sealed = json.loads((tmp_path / "sealed" / f"{case.name}.json").read_text())
        assert sealed["storage"]["every_s"] == case.every_s
        assert "level_quantisation" not in sealed["inherent"], "steps of a centimetre are no effect"
    with pytest.raises(ConfigError, match="holds a trial with another rates s"):
        run_fake("perfect", tmp_path, monkeypatch, seed=4, seconds=7200, storage=StoragePlan(absent=("head_m",)))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--every", "0"), "--every: got '0', must be a whole number of seconds from 1 to 3600"),
        (("--every", "10,1.5"), "--every: got '1.5', must be"),
        (("--value", "median"), "--value: got 'median', must be of instant, mean, held"),
        (("--without-signals", "inflow,heat"), "--without-signals: got 'heat', must be of level, inflow, flow"),
    ],
)
def test_options_of_storage_are_refused_in_one_line(options, said, run_wetwell, tmp_path, capsys):
    assert run_wetwell("gap", "trial", "--out", str(tmp_path / "t"), *options) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "t").exists()


def test_stations_of_swmm_have_soft_starters():
    cases = [trial_case(9, number, kinds=("none",), plants=("fine", "swmm"), seconds=600) for number in range(8)]
    assert {case.truth().station.control.ramp_s for case in cases if case.plant == "swmm"} <= {1.0, 2.0}
    assert min(case.truth().station.control.ramp_s for case in cases if case.plant == "fine") >= 6.0


def test_command_line(run_wetwell, folder, monkeypatch, capsys):
    monkeypatch.setenv("FAKE_MODE", "none")
    monkeypatch.setenv("FAKE_FOLDER", str(folder))
    days = str(SECONDS / 86_400)
    options = [
        "--seed",
        "3",
        "--cases",
        str(COUNT),
        "--days",
        days,
        "--diagnoser",
        " ".join(FAKE),
        "--out",
        str(folder),
    ]
    assert run_wetwell("gap", "trial", *options) == 0
    assert "trial.html" in capsys.readouterr().out
    assert run_wetwell("gap", "trial", *options, "--kinds", "sngle") == 2
    assert "--kinds: got 'sngle'" in capsys.readouterr().err
    assert run_wetwell("gap", "trial", *options, "--effects", "pump_wear,gremlins") == 2
    assert "--effects: got 'gremlins', must be of air_pocket, " in capsys.readouterr().err
    assert run_wetwell("gap", "trial", *options, "--plant", "swmm", "--effects", "water_inertia") == 2
    assert "--effects: got 'water_inertia', must be of " in capsys.readouterr().err
    assert run_wetwell("gap", "trial", *options, "--plant", "both", "--effects", "water_inertia") == 2
    assert "of which plant 'swmm' can show none" in capsys.readouterr().err


def test_effects_that_are_chosen_act_in_each_case_that_the_library_holds():
    chosen = ("pump_wear", "friction_bias")
    for number in range(12):
        case = trial_case(5, number, kinds=KINDS, plants=("fine", "swmm"), seconds=600, effects=chosen)
        assert case.kind in ("none", "open") or case.names[0] in chosen
    drawn = [
        trial_case(5, number, kinds=("single",), plants=("fine",), seconds=600, effects=chosen).names
        for number in range(4)
    ]
    assert sorted(drawn) == [("friction_bias",), ("friction_bias",), ("pump_wear",), ("pump_wear",)]


def test_swmm_without_pyswmm_says_what_to_install(alpha, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyswmm", None)
    with pytest.raises(WetwellError, match=r"needs pyswmm: pip install '\.\[trial\]'"):
        run_swmm(TruthCase(station=alpha, seconds=60))


def test_swmm_refuses_what_it_cannot_express(alpha):
    pytest.importorskip("pyswmm", exc_type=ImportError)
    with pytest.raises(ValueError, match="deviation 'ragging' is not one that SWMM can express"):
        run_swmm(TruthCase(station=alpha, deviations=(Deviation(name="ragging"),), seconds=60))


@pytest.mark.long
def test_a_trial_with_swmm(tmp_path, monkeypatch):
    pytest.importorskip("pyswmm", exc_type=ImportError)
    _, result = run_fake("perfect", tmp_path, monkeypatch, count=1, kinds=("single",), plants=("swmm",))
    assert result["plants_scored"]["swmm"]["top_1"]["value"] == 1.0
    recording = read_recording(tmp_path / "published" / "case-0000" / "recording.parquet")
    assert np.isfinite(recording.columns["level_m"]).all()


def test_a_seed_that_was_looked_at_is_refused(capsys, run_wetwell, tmp_path):
    options = ("gap", "trial", "--seed", "51004", "--cases", "1", "--kinds", "none", "--out", str(tmp_path / "t"))
    assert run_wetwell(*options) == 2
    assert "--seed: 51004 was looked at (cases of" in capsys.readouterr().err
    assert not (tmp_path / "t").exists()
    fake = (*options, "--looked-at", "--days", "0.02", "--diagnoser", "false")
    assert run_wetwell(*fake) == 0
    assert json.loads((tmp_path / "t/trial.json").read_bytes())["looked_at"]


def test_families_of_trials_stand_side_by_side(folder, monkeypatch):
    run_fake("perfect", folder, monkeypatch)
    rows = families_table([folder], ["swmm"])["scores"]
    assert [(row["family"], row["left out"], row["cases"]) for row in rows] == [("fine", "yes", COUNT)]
    assert rows[0]["exact_set"].startswith("1.00 [")
    assert rows[0]["calibration_error"] == "0.000"
    with pytest.raises(ConfigError, match="--learnt-on: got 'swm', must be of fine, swmm, elastic"):
        families_table([folder], ["swm"])
    with pytest.raises(ConfigError, match="cannot be read"):
        families_table([folder / "nothing"])
