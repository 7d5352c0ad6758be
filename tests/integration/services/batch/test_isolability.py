"""What can be told apart, from the command line; and the table of the documentation."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording, read_recording, write_recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.reports.isolability_table import signals_markdown
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

PAGE = Path(__file__).parents[4] / "docs" / "isolability.md"


@pytest.fixture(scope="module")
def recording(alpha, tmp_path_factory):
    path = tmp_path_factory.mktemp("isolability") / "field.parquet"
    rows = Simulation(alpha, Scenario(name="r"), 1).advance(14_400, truth=False)
    columns = {name: values for name, values in rows.columns.items() if "head" not in name and "inflow" not in name}
    write_recording(Recording(time_ns=rows.time_ns, columns=columns), path)
    return path


@pytest.mark.long
def test_the_table_of_the_page_is_that_of_the_code(alpha):
    assert signals_markdown(alpha) in PAGE.read_text(encoding="utf-8")


def test_signals_that_are_named(run_wetwell, capsys):
    assert run_wetwell("station", "show", "alpha", "--signals", "flow,power") == 0
    text = capsys.readouterr().out
    assert "signals: frequency, flow, power" in text
    assert "not told apart" in text
    assert run_wetwell("station", "show", "alpha", "--signals", "flow,power", "--json") == 0
    table = json.loads(capsys.readouterr().out)
    effects = {row["name"]: row for row in table["effects"]}
    assert effects["friction_bias"]["same_as"] == ["static_head_bias", "pump_wear", "motor_slip", "flow_meter_gain"]
    assert effects["head_sensor_offset"]["verdict"] == "not visible"
    assert table["duty_points"] == 24


def test_signals_and_points_of_a_recording_and_what_more_signals_would_tell(recording, run_wetwell, capsys):
    def asked(*more):
        assert run_wetwell("station", "show", "alpha", "--recording", recording, *more, "--json") == 0
        return json.loads(capsys.readouterr().out)

    table = asked()
    assert table["signals"] == ["frequency", "level", "flow", "power"]
    effects = {row["name"]: row for row in table["effects"]}
    assert "pump_wear" in effects["friction_bias"]["same_as"]
    more = {row["name"]: row for row in asked("--signals", "level,flow,power,head")["effects"]}
    assert "pump_wear" not in more["friction_bias"]["same_as"]


def test_a_recording_of_another_station_is_refused(recording, tmp_path, run_wetwell, capsys):
    south = tmp_path / "south.parquet"
    write_recording(replace(read_recording(recording), station="south"), south)
    assert run_wetwell("station", "show", "alpha", "--recording", south) == 2
    assert f"{south}: is of station 'south', not of 'alpha'" in capsys.readouterr().err
    assert run_wetwell("station", "show", "alpha", "--recording", south, "--as-station") == 0


def test_without_options_it_shows_the_duty_points(run_wetwell, capsys):
    assert run_wetwell("station", "show", "alpha") == 0
    assert "each_pump_alone" in capsys.readouterr().out


def test_what_cannot_be_used_is_told_in_one_line(recording, tmp_path, run_wetwell, capsys):
    assert run_wetwell("station", "show", "alpha", "--signals", "pressure") == 2
    assert capsys.readouterr().err.strip() == (
        "wetwell: --signals: got 'pressure', must be of level, inflow, flow, head, power"
    )
    one = tmp_path / "one.toml"
    one.write_text('name = "one"\n[sump]\narea_m2 = 8.0\n[[pump]]\ncurve = [36.0, -0.02, -1e-4]\n')
    assert run_wetwell("station", "show", one, "--recording", recording) == 2
    assert capsys.readouterr().err.strip() == f"wetwell: {recording}: has 3 pumps, station 'one' has 1"
    short = tmp_path / "short.csv"
    second = np.arange(9)
    write_recording(Recording(time_ns=NS_PER_S * second, columns={"pump3_flow_m3h": second.astype(float)}), short)
    assert run_wetwell("station", "show", "alpha", "--recording", short) == 2
    assert f"{short}: neither frequencies nor running flags have values" in capsys.readouterr().err
