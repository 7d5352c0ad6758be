"""Batches on a real Dask cluster: the bytes of one process, whatever fails on the way."""

import json
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("distributed")

import dask
from distributed import LocalCluster

from wetwell.protocols.errors import ConfigError, LinkError, WetwellError
from wetwell.protocols.recordings.recording import write_recording
from wetwell.services.batch import executors
from wetwell.services.batch.backtest import sources_of, write_backtest
from wetwell.services.batch.dataset import make_dataset, plan_of
from wetwell.services.batch.gap.diagnoses import cases_of, diagnose_all
from wetwell.services.batch.gap.diagnosis import diagnose_file
from wetwell.services.batch.parallel import Failure, work_through
from wetwell.services.trial.plan import TrialPlan
from wetwell.services.trial.run import run_trial
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

pytestmark = [pytest.mark.long, pytest.mark.filterwarnings("ignore")]  # of Dask's own threads and sockets

KILL = [0, 0, int(signal.SIGKILL), 0]
"""Signals to raise, of which one ends the process."""


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Address of a cluster of two workers, whose folder is not that of this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("elsewhere"))
        with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
            patch.undo()
            yield cluster.scheduler_address


@pytest.fixture(scope="module")
def recordings(alpha, tmp_path_factory):
    """A recording with truth, and one of which nothing can be said."""
    folder = tmp_path_factory.mktemp("recordings")
    recording = Simulation(alpha, Scenario(name="plain"), 3).advance(26_000)
    write_recording(recording, folder / "good.parquet")
    write_recording(replace(Simulation(alpha, Scenario(name="plain"), 1).advance(100), truth={}), folder / "bad.csv")
    return folder


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_a_dataset_goes_on_after_an_item_that_fails_and_has_the_bytes_of_one_process(
    alpha, scheduler, tmp_path, monkeypatch
):
    plan = plan_of([alpha], 5, 3, 0.3, "parquet")
    make_dataset(plan, tmp_path / "here", workers=1)
    (tmp_path / "there" / "000001.parquet").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    summary = make_dataset(plan, Path("there"), 1, scheduler)
    assert summary["items"] == 2
    (failed,) = summary["failed"]
    assert failed["item"] == 1
    assert failed["error"].endswith("000001.parquet: cannot be written: Is a directory")
    assert not (tmp_path / "there" / "manifest.json").exists()
    (tmp_path / "there" / "000001.parquet").rmdir()
    assert make_dataset(plan, Path("there"), 1, scheduler)["kept"] == 2
    assert files(tmp_path / "there") == files(tmp_path / "here")


def test_a_backtest_leaves_out_what_cannot_be_scored_and_resumes(
    alpha, recordings, scheduler, tmp_path, monkeypatch, run_wetwell, capsys
):
    monkeypatch.chdir(recordings)
    options = [
        "--station",
        "alpha",
        "--recording",
        "bad.csv",
        "--recording",
        "good.parquet",
        "--detectors",
        "always_normal",
    ]
    results = []
    for name, where in (("here", ["--workers", 1]), ("there", ["--scheduler", scheduler])):
        assert run_wetwell("backtest", *options, *where, "--out", tmp_path / name) == 1
        result = json.loads((tmp_path / name / "backtest.json").read_text())
        assert result["detectors"]["always_normal"].pop("judging_s_per_station_day") > 0.0
        results.append(result)
    assert results[0] == results[1]
    assert results[0]["recordings"] == ["good.parquet"]
    assert results[0]["failed"] == [
        {
            "recording": "bad.csv",
            "error": "bad.csv: column 'truth_pump1_state' is missing, so nothing can be scored",
        }
    ]
    assert "bad.csv" in capsys.readouterr().out
    assert "Not scored" in (tmp_path / "here" / "backtest.html").read_text()

    judged: list[str] = []
    real = write_backtest.__globals__["judge"]
    monkeypatch.setitem(
        write_backtest.__globals__,
        "judge",
        lambda source, **more: judged.append(source.name) or real(source, **more),
    )
    sources = sources_of(alpha, [recordings / "good.parquet"], [Scenario(name="new")], [1], 100)
    result = write_backtest(sources, ["always_normal"], tmp_path / "there", 1)
    assert judged == ["new, seed 1"]
    assert result["detectors"]["always_normal"]["recordings"] == 2
    assert not (tmp_path / "there" / "backtest.part.jsonl").exists()


def test_diagnoses_are_those_of_single_recordings_and_a_bad_one_is_told(
    alpha, recordings, scheduler, tmp_path, monkeypatch, run_wetwell, capsys
):
    (recordings / "wrong.toml").write_text("nothing = 1\n")
    (recordings / "other.csv").write_text("")
    (recordings / "table.csv").write_text("station_file,recording\nwrong.toml,other.csv\n")
    monkeypatch.chdir(recordings)
    arguments = ["--recording", "good.parquet", "--recording", "bad.csv", "--recordings", "table.csv"]
    arguments += [
        "--station",
        "alpha",
        "--only",
        "friction_bias",
        "--json",
        "--scheduler",
        scheduler,
        "--out",
        tmp_path / "there",
    ]
    assert run_wetwell("gap", "diagnose", *arguments) == 1
    result = json.loads(capsys.readouterr().out)
    diagnose_file(alpha, [recordings / "good.parquet"], tmp_path / "here", only=["friction_bias"])
    assert files(tmp_path / "there" / "good") == files(tmp_path / "here")
    assert [row["name"] for row in result["diagnoses"]] == ["good"]
    errors = {row["name"]: row["error"] for row in result["failed"]}
    assert set(errors) == {"bad", "other"}
    assert "wrong.toml" in errors["other"]
    assert not any("\n" in error for error in errors.values())
    monkeypatch.setattr(
        "wetwell.services.batch.gap.diagnoses.diagnose_file", None
    )  # what is there is not diagnosed again
    cases = cases_of("alpha", [Path("good.parquet")], None)
    again = diagnose_all(cases, tmp_path / "there", 1, only=["friction_bias"])
    assert again["diagnoses"] == result["diagnoses"]


def test_a_trial_scores_the_same(scheduler, tmp_path):
    command = (
        sys.executable,
        str(Path(__file__).parents[1] / "trial" / "fake_diagnoser.py"),
        "--only",
        "friction_bias",
    )
    plan = TrialPlan(seed=3, count=2, kinds=("none",), seconds=3600, command=command)
    results = [run_trial(plan, tmp_path / name, 1, where) for name, where in (("a", None), ("b", scheduler))]
    assert results[0] == results[1]
    assert results[0]["count"] == 2
    assert results[0]["failed"] == []


@pytest.mark.parametrize("where", [None, "local"])
def test_a_task_that_kills_its_process_is_one_failure(where):
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        results = dict(work_through(signal.raise_signal, KILL, len(KILL), 2, "kill", where))
    failed = {number for number, result in results.items() if isinstance(result, Failure)}
    assert set(results) == {0, 1, 2, 3}
    assert 2 in failed
    assert len(failed) < (4 if where else 2)  # Dask may give up what is on the same worker, too


def test_what_cannot_be_a_scheduler_is_one_line(tmp_path, monkeypatch, run_wetwell, capsys):
    assert run_wetwell("dataset", "--station", "alpha", "--out", tmp_path / "set", "--scheduler", "here") == 2
    said = "--scheduler: got 'here', must be tcp://HOST:PORT, tls://HOST:PORT or local"
    assert capsys.readouterr().err.splitlines() == [f"wetwell: {said}"]
    monkeypatch.setattr(executors, "CONNECT_S", 0.5)
    with pytest.raises(LinkError, match=r"--scheduler: no scheduler answers at tcp://127\.0\.0\.1:9$"):
        list(work_through(abs, [1], 1, 1, "x", "tcp://127.0.0.1:9"))
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ConfigError, match=r"--scheduler: needs the extra 'fleet' \(pip install '\.\[fleet\]'\)"):
        executors.check_scheduler("local")
    assert not (tmp_path / "set").exists()


def test_nothing_but_failures_is_an_error(tmp_path):
    (tmp_path / "bad.csv").write_text("")
    with pytest.raises(WetwellError, match=r"bad.csv.*\(and 1 more\)"):
        diagnose_all(cases_of("alpha", [tmp_path / "bad.csv", tmp_path / "none.csv"], None), tmp_path / "out", 1)
    assert not (tmp_path / "out").exists()
    with pytest.raises(ConfigError, match="two recordings are called 'bad'"):
        cases_of("alpha", [tmp_path / "bad.csv", tmp_path / "bad.parquet"], None)
