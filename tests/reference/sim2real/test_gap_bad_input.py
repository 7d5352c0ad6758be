"""Recordings that are no gap but a mistake: the command says what is wrong, and names no effect with confidence."""

import json

import numpy as np
import pytest
import tomli_w

from wetwell.protocols.recordings.recording import Recording, write_recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_scenario
from wetwell.simulator.simulation import Simulation

LENGTH_S = 14_400


@pytest.fixture(scope="module")
def rows(alpha):
    return Simulation(alpha, find_scenario("nominal"), 7).advance(LENGTH_S, truth=False)


def changed(recording, ending, change):
    columns = {name: change(v) if name.endswith(ending) else v for name, v in recording.columns.items()}
    return Recording(time_ns=recording.time_ns, columns=columns)


def scaled(ending, factor):
    return lambda r: changed(r, ending, lambda values: values * factor)


def cut(rows):
    return lambda r: Recording(time_ns=r.time_ns[rows], columns={n: v[rows] for n, v in r.columns.items()})


def shuffled(recording):
    order = np.random.default_rng(1).permutation(len(recording))
    return Recording(time_ns=recording.time_ns, columns={n: v[order] for n, v in recording.columns.items()})


def constant(recording):
    return Recording(time_ns=recording.time_ns, columns={n: v * 0.0 + v[200] for n, v in recording.columns.items()})


@pytest.fixture
def diagnose(run_wetwell, tmp_path, monkeypatch, capsys):
    """Function that runs the command on a recording; gives exit code, standard output and standard error."""

    def run(recording, station):
        write_recording(recording, tmp_path / "field.parquet")
        table = station.model_dump(mode="json", exclude_none=True)
        (tmp_path / "station.toml").write_text(tomli_w.dumps(table), "utf-8")
        monkeypatch.chdir(tmp_path)
        command = ["gap", "diagnose", "--station", "station.toml", "--recording", "field.parquet"]
        code = run_wetwell(*command, "--out", "out", "--json", "--only", "friction_bias")
        return code, *capsys.readouterr()

    return run


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (cut(slice(0, 900)), "the recording is 900 s long, a diagnosis needs at least 1800 s"),
        (scaled("_frequency_hz", 0.0), "has 0 starts of pumps"),
        (constant, "has 0 starts of pumps"),
        (shuffled, "the rows are in no order of time"),
        (scaled("flow_m3h", 1 / 3.6), "as if in L/s: prepare the recording with a scale of 3.6"),
        (scaled("inflow_m3h", 1 / 3.6), "carry away, as if in L/s: prepare the recording with a scale of 3.6"),
        (scaled("_head_m", 1 / 10.197), "as if in bar: prepare the recording with a scale of 10.2"),
        (scaled("_head_m", 9.8067), "as if in kPa"),
        (scaled("_power_kw", 1000.0), "as if in W: prepare the recording with a scale of 0.001"),
        (scaled("level_m", 100.0), "as if in cm: prepare the recording with a scale of 0.01"),
        (scaled("level_m", 30.0), "such as % of a span"),
        (scaled("_frequency_hz", 2.0), "as if in % of nominal: prepare the recording with a scale of 0.5"),
    ],
)
def test_a_mistake_is_said_and_nothing_is_written(alpha, rows, diagnose, tmp_path, change, message):
    code, out, error = diagnose(change(rows), alpha)
    assert (code, out) == (2, "")
    assert message in error
    assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_the_file_of_another_station_is_noticed(alpha, rows, diagnose):
    table = alpha.model_dump(mode="json", exclude_none=True)
    table["sump"]["area_m2"] = 3.0 * alpha.sump.area_m2
    table["control"]["start_levels_m"] = [level + 1.0 for level in alpha.control.start_levels_m]
    table["rising_main"]["static_head_m"] = 0.3 * alpha.rising_main.static_head_m
    table["rising_main"]["friction_h2_m5"] = 0.1 * alpha.rising_main.friction_h2_m5
    code, _, error = diagnose(rows, Station.model_validate(table))
    assert code == 2
    assert "this looks like a recording of another station than 'alpha'" in error


def test_gaps_are_bridged_and_no_gap_of_the_simulator(alpha, rows, diagnose):
    second = np.arange(len(rows))
    is_kept = ((second < 5000) | (second > 7000)) & (second % 1800 > 45)
    code, out, _ = diagnose(cut(is_kept)(rows), alpha)
    assert (code, json.loads(out)["verdict"]) == (0, "none")


def test_a_channel_that_never_moves_is_passed_over_and_named(alpha, rows, diagnose):
    code, out, _ = diagnose(changed(rows, "_head_m", lambda values: 0.0 * values + 20.0), alpha)
    report = json.loads(out)
    assert (code, report["verdict"]) == (0, "none")
    assert "head" not in report["signals"]
    assert any(note.startswith("no head") for note in report["notes"])


def test_rows_out_of_order_with_their_stamps_are_put_in_order(alpha, rows, diagnose):
    order = np.random.default_rng(2).permutation(len(rows))
    code, out, _ = diagnose(cut(order)(rows), alpha)
    report = json.loads(out)
    assert (code, report["verdict"]) == (0, "none")
    assert "rows stood before an earlier one" in report["notes"][0]
