"""From a recording that leaves two causes open, over the act that is proposed, to one answer; by the command line."""

import json
import subprocess
import sys
from dataclasses import replace

import pytest

from wetwell.protocols.recordings.recording import read_recording, write_recording
from wetwell.protocols.station.station_file import EffectTable, load_station
from wetwell.services.stations import find_scenario
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.simulator.scenario import DEFAULT_START_NS
from wetwell.simulator.simulation import Simulation

pytestmark = pytest.mark.long

ONLY = ("motor_slip", "friction_bias", "static_head_bias")
STATION = """name = "north"
[sump]
area_m2 = 8.0
[[pump]]
curve = [36.0, -0.02333, -1.3333e-4]
[[pump]]
curve = [36.0, -0.02333, -1.3333e-4]
"""
SLIP = '[[effect]]\nname = "motor_slip"\nslip = 0.015\n'


def wetwell(*arguments):
    """Code, output and error of a command, in a process of its own."""
    command = [sys.executable, "-m", "wetwell.services", *map(str, arguments)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    return ended.returncode, ended.stdout, ended.stderr


def leave_out_heads(path):
    """A station without a meter of head: slip then looks like friction, as long as the speed is always the same."""
    recording = read_recording(path)
    columns = {name: values for name, values in recording.columns.items() if not name.endswith("_head_m")}
    write_recording(replace(recording, columns=columns, truth={}), path)


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Folder with both stations, both recordings, and the diagnoses of the first and of both."""
    folder = tmp_path_factory.mktemp("act")
    north, real, before, during = (folder / name for name in ("north.toml", "real.toml", "before.csv", "during.csv"))
    north.write_text(STATION)
    real.write_text(STATION + SLIP)
    first, both = folder / "first", folder / "both"
    only = [part for name in ONLY for part in ("--only", name)]
    begin = ("--begin", "2025-02-01T06:00:00Z")
    act = ("--act", first / "report.json")
    for call in (
        ("simulate", "--station", real, "--days", "0.0834", "--seed", "5", "--out", before),
        ("gap", "diagnose", "--station", north, "--recording", before, "--out", first, *only),
        ("simulate", "--station", real, "--days", "0.1", "--seed", "6", *act, *begin, "--out", during),
        ("gap", "diagnose", "--station", north, "--recording", before, "--recording", during, "--out", both, *only),
    ):
        code, _, error = wetwell(*call)
        assert code == 0, error
        if call[0] == "simulate":
            leave_out_heads(call[-1])
    return folder


def test_the_first_act_tells_what_the_first_recording_could_not(answers):
    first, both = (json.loads((answers / name / "report.json").read_text()) for name in ("first", "both"))
    assert first["experiments"][0]["information_bits"] > 0.05
    assert first["next_experiment"].startswith(first["experiments"][0]["sentence"])
    assert both["verdict"] == "effect"
    assert [effect["name"] for effect in both["effects"]] == ["motor_slip"]
    before, after = (
        {tuple(one["effects"]): one["probability"] for one in told["posterior"] if one["verdict"] == "effect"}
        for told in (first, both)
    )
    assert after["motor_slip",] / sum(after.values()) > max(before["motor_slip",] / sum(before.values()), 0.99)
    assert [one["is_by_hand"] for one in both["recordings"]] == [False, True]


def test_what_a_crew_switches_is_no_shifted_threshold(answers):
    """The same act on a station that is as its file says, with every effect of the controller in the library."""
    station = load_station(answers / "real.toml")
    recordings = [read_recording(answers / name) for name in ("before.csv", "during.csv")]
    report = diagnose(recordings, station, only=["threshold_shift", "control_delay"]).report()
    assert report.verdict == "none"


def test_experiment_prints_what_it_weighs_and_refuses_other_folders(answers, tmp_path):
    code, out, _ = wetwell("gap", "experiment", answers / "first")
    assert code == 0
    assert "prices (defaults: the station file has no [costs]): 0.25 a kWh, 75 an hour of work" in out
    code, out, _ = wetwell("gap", "experiment", str(answers / "first"), "--inflow", "30", "--json")
    told = json.loads(out)
    assert (code, told["schema"], told["inflow_m3h"]) == (0, "wetwell.gap-experiments/1", 30.0)
    assert sum(one["probability"] for one in told["sets"]) <= 1.0 + 1e-6
    code, _, error = wetwell("gap", "experiment", str(tmp_path))
    assert code == 2
    assert "left_open.json: cannot be read" in error
    assert len(error.strip().splitlines()) == 1


def test_recordings_that_overlap_are_refused_in_one_line(answers, tmp_path):
    write_recording(read_recording(answers / "before.csv"), tmp_path / "again.csv")
    code, _, error = wetwell(
        *("gap", "diagnose", "--station", str(answers / "north.toml"), "--out", str(tmp_path / "out")),
        *("--recording", str(answers / "before.csv"), "--recording", str(tmp_path / "again.csv")),
    )
    assert code == 2
    assert "two recordings overlap in time: give each second once" in error
    assert not (tmp_path / "out").exists()


def test_friction_that_grew_between_two_weeks_has_a_value_in_each(answers):
    station, week_ns = load_station(answers / "north.toml"), 7 * 86_400 * 10**9
    weeks = [rough(station, factor, 5 + k, DEFAULT_START_NS + k * week_ns) for k, factor in enumerate((1.1, 1.3))]
    found = diagnose(weeks, station, only=ONLY)
    (effect,) = found.report().effects
    assert (effect.name, "factor" in effect.differs) == ("friction_bias", True)
    assert effect.parameters["factor@1"].value == pytest.approx(1.1, rel=0.02)
    assert effect.parameters["factor"].value == pytest.approx(1.3, rel=0.02)
    assert found.station.effect[0].model_dump()["factor"] == pytest.approx(1.3, rel=0.02)


def test_friction_that_stayed_has_one_value(answers):
    station, week_ns = load_station(answers / "north.toml"), 7 * 86_400 * 10**9
    weeks = [rough(station, 1.2, 5 + k, DEFAULT_START_NS + k * week_ns) for k in range(2)]
    (effect,) = diagnose(weeks, station, only=ONLY).report().effects
    assert (effect.name, effect.differs) == ("friction_bias", ())
    assert effect.parameters["factor"].value == pytest.approx(1.2, rel=0.02)


def rough(station, factor, seed, start_ns):
    """Six hours of a station whose main is rougher."""
    friction = EffectTable.model_validate({"name": "friction_bias", "factor": factor})
    real = station.model_copy(update={"effect": (friction,)})
    return Simulation(real, find_scenario("nominal"), seed, start_ns).advance(21_600, truth=False)
