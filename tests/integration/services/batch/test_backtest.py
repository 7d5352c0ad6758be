"""`wetwell backtest` from the command line, on recordings, scenarios and a dataset."""

import json
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest

from wetwell.protocols.recordings.recording import write_recording
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SHORT = Scenario(
    name="short",
    fault=(
        Blockage(pump=1, speed_loss=0.3, start_s=22_500, end_s=25_500, after="clear", shape="step"),
        PipeClogging(friction_rise=1.0, start_s=26_000, end_s=28_000, after="hold"),
    ),
)


@pytest.fixture(scope="module")
def recordings(alpha, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    paths = [folder / "one.parquet", folder / "two.csv"]
    for seed, path in enumerate(paths, start=1):
        write_recording(Simulation(alpha, SHORT, seed).advance(30_000), path)
    return paths


def test_two_recordings_give_one_report_whatever_the_number_of_workers(recordings, run_wetwell, tmp_path, capsys):
    results = []
    for workers in (1, 2):
        out = tmp_path / str(workers)
        arguments = [argument for path in recordings for argument in ("--recording", path)]
        arguments += ["--station", "alpha", "--detectors", "wetwell,paper_f_test", "--workers", workers, "--out", out]
        assert run_wetwell("backtest", *arguments) == 0
        result = json.loads((out / "backtest.json").read_text())
        for figures in result["detectors"].values():
            assert figures.pop("judging_s_per_station_day") > 0.0
        results.append(result)
        page = (out / "backtest.html").read_text()
        ET.fromstring(page.partition("\n")[2])  # noqa: S314 - our own page, must be well formed
        assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
    assert results[0] == results[1]
    assert "paper_f_test" in capsys.readouterr().out
    result = results[0]
    assert result["recordings"] == [str(path) for path in recordings]
    ours = result["detectors"]["wetwell"]
    assert set(ours["states"]) == {"normal", "pump_fault", "system_fault"}
    assert sum(map(sum, ours["confusion"]["runs"])) == ours["runs"] == result["detectors"]["paper_f_test"]["runs"]
    assert ours["detection"]["system_fault"]["faults"] == 2
    assert ours["detection"]["system_fault"]["missed"] == 0
    assert {row["kind"] for row in ours["kinds"]} == {"blockage", "pipe_clogging"}
    assert ours["macro_f1"] > result["detectors"]["paper_f_test"]["macro_f1"]
    assert ours["reliability"]["brier"] < 0.1
    assert result["detectors"]["paper_f_test"]["reliability"] is None


def test_a_scenario_is_simulated_and_the_result_printed(run_wetwell, tmp_path, capsys):
    arguments = [
        "--station",
        "alpha",
        "--scenario",
        "nominal",
        "--seeds",
        2,
        "--first-seed",
        7,
        "--days",
        0.3,
        "--workers",
        1,
    ]
    assert run_wetwell("backtest", *arguments, "--detectors", "always_normal", "--out", tmp_path, "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "backtest.json").read_text())
    assert printed["recordings"] == ["nominal, seed 7", "nominal, seed 8"]
    figures = printed["detectors"]["always_normal"]
    assert figures["macro_f1"] == 1.0
    assert figures["false_alarms"]["count"] == 0
    assert figures["detection"] == {}


def test_what_cannot_be_scored_is_said_in_one_line(alpha, run_wetwell, tmp_path, capsys):
    bare = tmp_path / "bare.csv"
    write_recording(replace(Simulation(alpha, SHORT, 1).advance(100), truth={}), bare)
    for arguments, said in (
        (
            ["--station", "alpha", "--recording", bare],
            f"{bare}: column 'truth_pump1_state' is missing, so nothing can be scored",
        ),
        (["--recording", bare], "backtest: give --station FILE with --recording and --scenario"),
        ([], "backtest: give at least one --recording, --scenario or --dataset"),
        (["--dataset", tmp_path], f"{tmp_path}/manifest.json: cannot be read"),
        (["--station", "alpha", "--recording", bare, "--detectors", "oracle"], "detector 'oracle' is none of"),
    ):
        assert run_wetwell("backtest", *arguments, "--workers", 1, "--out", tmp_path / "out") == 2
        error = capsys.readouterr().err.strip()
        assert said in error
        assert len(error.splitlines()) == 1
        assert not (tmp_path / "out").exists()
