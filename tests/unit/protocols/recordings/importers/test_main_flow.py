"""One flow meter in the main of several pumps: whose flow it tells, and when it tells none."""

import numpy as np
import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.recordings.importers.conversion import convert
from wetwell.protocols.recordings.importers.mapping import load_mapping
from wetwell.protocols.recordings.importers.signals.main_flow import hand_out, runs_of

NAN = np.nan
TWO_PUMPS = """
station = "north"
layout = "wide"
{top}
[columns]
time = "time"
[signal.level_m]
tag = "LT"
[signal.main1_flow_m3h]
tag = "FT"
unit = "l/s"
{main}
[signal.pump1_running]
tag = "P1"
[signal.pump2_running]
tag = "P2"
{more}
"""


def written(tmp_path, text):
    path = tmp_path / "mapping.toml"
    path.write_text(text, encoding="utf-8")
    return path


def converted(tmp_path, rows, header="time;LT;FT;P1;P2", **parts):
    """What a mapping of two pumps makes of an export with a row every ten seconds."""
    path = tmp_path / "export.csv"
    lines = (f"2025-01-06T00:{10 * k // 60:02}:{10 * k % 60:02}Z;1.5;{row}\n" for k, row in enumerate(rows))
    path.write_text(f"{header}\n" + "".join(lines))
    mapping = load_mapping(written(tmp_path, TWO_PUMPS.format(**({"top": "", "main": "", "more": ""} | parts))))
    return convert([path], mapping)


@pytest.mark.parametrize(
    ("running", "flows"),
    [
        ((1.0, 0.0, 0.0), (90.0, 0.0, 0.0)),
        ((0.0, 0.0, 1.0), (0.0, 0.0, 90.0)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((1.0, 1.0, 0.0), (NAN, NAN, 0.0)),
        ((1.0, 1.0, 1.0), (NAN, NAN, NAN)),
        ((1.0, NAN, 0.0), (NAN, NAN, 0.0)),
        ((NAN, 0.0, 0.0), (NAN, 0.0, 0.0)),
        ((1.0, 1.0, NAN), (NAN, NAN, NAN)),
        ((NAN, NAN, NAN), (NAN, NAN, NAN)),
    ],
)
def test_a_flow_is_that_of_the_only_pump_that_runs(running, flows):
    done = hand_out(np.array([90.0]), {pump: np.array([run]) for pump, run in enumerate(running, start=1)})
    np.testing.assert_array_equal([done.flow_m3h[pump][0] for pump in (1, 2, 3)], flows)
    assert done.one_runs + done.several_run + done.unknown + done.none_runs == 1
    assert done.several_run == (sum(np.array(running) == 1.0) > 1)


def test_without_a_value_of_the_meter_only_standing_pumps_have_one():
    done = hand_out(np.array([NAN, NAN, NAN]), {1: np.array([1.0, 0.0, 1.0]), 2: np.array([0.0, 0.0, 1.0])})
    np.testing.assert_array_equal(done.flow_m3h[1], [NAN, 0.0, NAN])
    np.testing.assert_array_equal(done.flow_m3h[2], [0.0, 0.0, NAN])
    assert (done.one_runs, done.several_run, done.unknown, done.none_runs) == (0, 0, 0, 0)
    assert np.isnan(done.high_m3h)


def test_a_back_flow_is_of_the_pump_that_runs():
    done = hand_out(np.array([-3.0, -3.0]), {1: np.array([1.0, 0.0]), 2: np.array([0.0, 0.0])})
    np.testing.assert_array_equal(done.flow_m3h[1], [-3.0, 0.0])
    assert done.high_m3h == -3.0


def test_a_run_is_told_by_the_flag_and_by_the_frequency_where_the_flag_says_nothing():
    columns = {
        "pump1_running": np.array([0.25, 0.0, NAN, NAN, 0.0]),
        "pump1_frequency_hz": np.array([0.0, 0.0, 12.5, NAN, 50.0]),
        "pump2_frequency_hz": np.array([0.0, 0.1, NAN, 50.0, 0.0]),
    }
    runs = runs_of(columns, (1, 2, 3), 5)
    np.testing.assert_array_equal(runs[1], [1.0, 0.0, 1.0, NAN, 0.0])
    np.testing.assert_array_equal(runs[2], [0.0, 1.0, NAN, 1.0, 0.0])
    np.testing.assert_array_equal(runs[3], [NAN] * 5)


def test_it_becomes_the_flows_of_the_pumps_and_no_column(tmp_path):
    done = converted(tmp_path, ["25;1;0", "40;1;1", "24;0;1", "2;0;0", "25;1;", ";1;0"])
    columns = done.recording.columns
    assert list(columns) == ["level_m", "pump1_flow_m3h", "pump2_flow_m3h", "pump1_running", "pump2_running"]
    np.testing.assert_allclose(columns["pump1_flow_m3h"], [90.0, NAN, 0.0, 0.0, NAN, NAN])
    np.testing.assert_allclose(columns["pump2_flow_m3h"], [0.0, NAN, 86.4, 0.0, NAN, 0.0])
    flow = done.main_flows["main1_flow_m3h"]
    assert (flow.one_runs, flow.several_run, flow.unknown, flow.none_runs) == (2, 1, 1, 1)
    assert flow.high_m3h == pytest.approx(7.2)
    assert done.unmapped == {}


def test_the_mean_of_an_interval_is_that_of_the_only_pump_that_ran_in_it(tmp_path):
    """A pump that ran for a quarter of the interval has the mean of all of it, as a meter of its own would tell."""
    rows = ["6.25;0.25;0", "25;1;0", "20;0.5;0.25", "0.5;0;0"]
    done = converted(tmp_path, rows, top='value = "mean"', more='[signal.pump1_frequency_hz]\ntag = "P1"\nscale = 50')
    assert done.recording.value == "mean"
    np.testing.assert_allclose(done.recording.columns["pump1_flow_m3h"], [22.5, 90.0, NAN, 0.0])
    np.testing.assert_allclose(done.recording.columns["pump2_flow_m3h"], [0.0, 0.0, NAN, 0.0])


def test_values_stored_on_change_are_handed_out_where_they_hold(tmp_path):
    rows = ["25;1;0", ";;", ";;1", ";0;", ";;", "20;;"]
    done = converted(tmp_path, rows, top='value = "held"\nmax_age_s = 600.0\nstep_s = 10.0', main="max_age_s = 30.0")
    np.testing.assert_allclose(done.recording.columns["pump1_flow_m3h"], [90.0, 90.0, NAN, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(done.recording.columns["pump2_flow_m3h"], [0.0, 0.0, NAN, 90.0, NAN, 72.0])


def test_each_main_has_its_meter_and_a_pump_without_main_its_own(tmp_path):
    more = "".join(f'[signal.pump{pump}_frequency_hz]\ntag = "P{pump}"\n' for pump in (3, 4))
    more += '[signal.main2_flow_m3h]\ntag = "FT2"\npumps = [3]\n[signal.pump4_flow_m3h]\ntag = "FT4"\n'
    header = "time;LT;FT;P1;P2;P3;P4;FT2;FT4"
    done = converted(tmp_path, ["25;1;0;50;50;100;70"], header, main="pumps = [2, 1]", more=more)
    flows = [done.recording.columns[f"pump{pump}_flow_m3h"].tolist() for pump in (1, 2, 3, 4)]
    assert flows == [[90.0], [0.0], [100.0], [70.0]]


RUNS_OF_PUMP_3 = '[signal.pump3_running]\ntag = "P3"\n'


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (
            {"more": '[signal.pump2_flow_m3h]\ntag = "F2"'},
            "signal.main1_flow_m3h.pumps: got 2, which has a flow of its own, pump2_flow_m3h",
        ),
        ({"more": 'pumps = [1]\ntrue = ["1"]'}, "signal.pump2_running.pumps: is for main1_flow_m3h and so on"),
        ({"main": "pumps = [1, 3]"}, "signal.main1_flow_m3h.pumps: got 3, the mapping has signals of pump 1, 2"),
        ({"main": "pumps = [1, 1]"}, "signal.main1_flow_m3h.pumps: got 1, which comes twice"),
        (
            {"main": "pumps = [0]"},
            "signal.main1_flow_m3h.pumps[1]: got 0, input should be greater than or equal to 1",
        ),
        ({"main": "pumps = []"}, "signal.main1_flow_m3h.pumps: got [], tuple should have at least 1 item"),
        (
            {"main": "pumps = [1]", "more": '[signal.main2_flow_m3h]\ntag = "F2"\npumps = [2, 1]'},
            "signal.main2_flow_m3h.pumps: got 1, which is in main1_flow_m3h already",
        ),
        (
            {"main": "pumps = [1]", "more": '[signal.main2_flow_m3h]\ntag = "F2"'},
            "signal.main2_flow_m3h.pumps: missing, each of several mains needs its own",
        ),
        (
            {"more": '[signal.pump3_power_kw]\ntag = "J3"'},
            "signal.main1_flow_m3h.pumps: got 3, which needs pump3_running or pump3_frequency_hz, to tell",
        ),
        (
            {"more": '[signal.main0_flow_m3h]\ntag = "F"'},
            "signal.main0_flow_m3h: is no column of a recording",
        ),
        ({"more": '[signal.main1_head_m]\ntag = "F"'}, "signal.main1_head_m: is no column of a recording, must be"),
        ({"main": 'true = ["1"]'}, "signal.main1_flow_m3h.true: is for pump1_running and so on"),
    ],
)
def test_a_mapping_that_breaks_a_rule_is_refused_in_one_line(tmp_path, parts, said):
    path = written(tmp_path, TWO_PUMPS.format(**({"top": "", "main": "", "more": ""} | parts)))
    with pytest.raises(ConfigError) as caught:
        load_mapping(path)
    assert str(caught.value).startswith(f"{path}: {said}")
    assert "\n" not in str(caught.value)


def test_a_unit_that_is_none_of_a_flow_is_refused(tmp_path):
    text = TWO_PUMPS.format(top="", main="", more="").replace('"l/s"', '"bar"')
    with pytest.raises(ConfigError, match=r"signal\.main1_flow_m3h\.unit: got 'bar', must be one of m³/h"):
        load_mapping(written(tmp_path, text))


def test_the_command_tells_what_became_of_it(tmp_path, run_wetwell, capsys):
    converted(tmp_path, ["25;1;0", "40;1;1", "39;1;1", "2;0;0"])
    arguments = (tmp_path / "export.csv", "--mapping", tmp_path / "mapping.toml", "--out", tmp_path / "r.csv")
    assert run_wetwell("convert", *arguments) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["pump1_flow_m3h", "FT", "2", "0.0", "90.0"] in lines
    assert ["main1_flow_m3h", "1,", "2", "1", "2", "0", "1", "7.2"] in lines
