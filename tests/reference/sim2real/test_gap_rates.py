"""The diagnosis on recordings as historians store them: slow rows, means, values that are held, missing signals."""

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording, read_recording, write_recording
from wetwell.protocols.station.station_file import EffectTable
from wetwell.services.batch.gap.diagnosis import replay_file
from wetwell.services.stations import find_scenario
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.recording.regimes import REGIMES, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import SIGNALS
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.simulation import Simulation

LENGTH_S = 43_200
CONTROLLER = ("threshold_shift", "control_delay", "sump_area_profile")
RATES = [(1, "instant"), (5, "instant"), (10, "instant"), (60, "instant"), (10, "mean"), (60, "mean"), (900, "mean")]


def record(station, effects=(), seed=23, length_s=LENGTH_S):
    tables = tuple(EffectTable.model_validate(effect) for effect in effects)
    true = station.model_copy(update={"effect": tables})
    return Simulation(true, find_scenario("nominal"), seed).advance(length_s, truth=False)


def stored(recording, every, value="instant", without=()):
    """What a historian keeps of a recording of each second."""
    columns = {n: v for n, v in recording.columns.items() if not any(word in n for word in without)}
    if value == "mean":
        count = len(recording) // every
        return Recording(
            time_ns=recording.time_ns[every - 1 :: every][:count],
            columns={n: v[: count * every].reshape(count, every).mean(axis=1) for n, v in columns.items()},
            value="mean",
        )
    rows = slice(0, None, every)
    kept = {n: v[rows] for n, v in columns.items()}
    if value == "held":
        kept = {n: v if n.endswith(("_hz", "running")) else _held(v) for n, v in kept.items()}
    return Recording(time_ns=recording.time_ns[rows], columns=kept, value=value)


def _held(values):
    """Values that are stored when they have moved by a fiftieth of their range."""
    last, kept = values[0], values.copy()
    for row, value in enumerate(values):
        if abs(value - last) > 0.02 * np.ptp(values):
            last = value
        kept[row] = last
    return kept


@pytest.fixture(scope="module")
def plain(alpha):
    return record(alpha)


@pytest.mark.parametrize("without", [(), ("inflow",)])
@pytest.mark.parametrize(("every", "value"), RATES)
def test_the_true_model_is_off_by_about_what_it_may_be(alpha, plain, every, value, without):
    """Mean squares of standardised residuals by signal and regime: noise makes 1, tolerance alone less."""
    traces = traces_of(stored(plain, every, value, without), alpha)
    regimes = regimes_of(traces, alpha)
    replay = Replay(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes, replay.run(), replay.doubt)
    squares = residuals.of(replay.run()) ** 2
    cells = list(residuals.bins.cells(np.ones(squares.size, dtype=bool)))
    assert len(cells) >= 3
    for signal, regime, cell in cells:
        is_surging = bool(without) and SIGNALS[signal] == "level"  # by surges that nobody measured
        assert squares[cell].mean() < (2.2 if is_surging else 1.6), (SIGNALS[signal], REGIMES[regime])
    assert np.all(residuals.bins.deviation > 0.0)


@pytest.mark.parametrize(
    ("every", "value", "without"),
    [
        pytest.param(10, "instant", (), marks=pytest.mark.long),
        pytest.param(10, "instant", ("inflow", "head"), marks=pytest.mark.long),
        pytest.param(60, "instant", ("inflow",), marks=pytest.mark.long),
        pytest.param(60, "instant", ("flow_m3h", "head"), marks=pytest.mark.long),
        (60, "mean", ("inflow",)),
        pytest.param(900, "mean", ("inflow",), marks=pytest.mark.long),
        pytest.param(10, "held", ("inflow",), marks=pytest.mark.long),
    ],
)
def test_without_a_gap_nobody_is_blamed(alpha, plain, every, value, without):
    report = diagnose(stored(plain, every, value, without), alpha).report()
    assert (report.verdict, report.effects) == ("none", ())
    assert (report.rate_s, report.value) == (float(every), value)


def test_an_inflow_that_is_another_in_each_second_is_no_lag_of_the_level(alpha):
    """Slopes at a lag of .3 s promise much at 5 s, which is not there."""
    report = diagnose(stored(record(alpha, seed=24), 1, without=("inflow",)), alpha).report()
    assert (report.verdict, report.effects) == ("none", ())


@pytest.mark.long
def test_a_lag_that_is_not_there_gains_nothing_by_a_filter_that_corrects_too_much(alpha):
    """In rows of 5 s: behind a lag of two the inflow makes less of the bends of a level, and the sensor more."""
    report = diagnose(stored(record(alpha, seed=31, length_s=86_400), 5, without=("inflow",)), alpha).report()
    assert (report.verdict, report.effects) == ("none", ())


@pytest.mark.parametrize(
    ("every", "value", "without"),
    [
        pytest.param(1, "instant", ("inflow",), marks=pytest.mark.long),
        pytest.param(10, "instant", ("inflow",), marks=pytest.mark.long),
        pytest.param(60, "instant", (), marks=pytest.mark.long),
        pytest.param(60, "mean", ("inflow",), marks=pytest.mark.long),
        (900, "mean", ()),
        pytest.param(10, "held", (), marks=pytest.mark.long),
    ],
)
def test_friction_is_told_at_every_rate(alpha, every, value, without):
    recording = stored(record(alpha, [{"name": "friction_bias", "factor": 1.4}]), every, value, without)
    told = diagnose(recording, alpha)
    assert told.verdict == "effect"
    found = [effect for effect in told.effects if effect.name == "friction_bias"]
    if found:
        assert found[0].parameters["factor"].value == pytest.approx(1.4, rel=0.1)
    else:
        assert any("friction_bias" in effect.equivalent for effect in told.effects)


@pytest.mark.parametrize("without", [(), ("inflow",)])
def test_a_lag_of_the_level_is_told_in_rows_of_a_minute(alpha, without):
    recording = stored(record(alpha, [{"name": "level_sensor_lag", "lag_s": 20.0}]), 60, "instant", without)
    (found,) = diagnose(recording, alpha, only=["level_sensor_lag", "sump_area_profile"]).effects
    assert found.name == "level_sensor_lag"
    assert found.parameters["lag_s"].value == pytest.approx(20.0, abs=5.0)


@pytest.mark.long
@pytest.mark.parametrize("lag_s", [12.0, 29.0])
def test_a_lag_of_the_level_is_no_other_effect_where_nobody_measures_the_inflow(alpha, lag_s):
    recording = stored(record(alpha, [{"name": "level_sensor_lag", "lag_s": lag_s}]), 1, without=("inflow",))
    (told,) = diagnose(recording, alpha).effects
    assert told.name == "level_sensor_lag"
    assert told.parameters["lag_s"].value == pytest.approx(lag_s, rel=0.05)


@pytest.mark.parametrize(("every", "value"), [(10, "instant"), (60, "instant"), (60, "mean")])
def test_other_start_and_stop_levels_are_told_in_slow_rows(alpha, every, value):
    true = record(alpha, [{"name": "threshold_shift", "start_m": 0.15, "stop_m": 0.05}])
    (told,) = diagnose(stored(true, every, value, ("inflow",)), alpha, only=CONTROLLER).effects
    assert told.name == "threshold_shift"
    assert told.parameters["start_m"].value == pytest.approx(0.15, abs=0.02)
    assert told.parameters["stop_m"].value == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize(("every", "value"), [(10, "instant"), (60, "instant"), (60, "mean")])
def test_a_late_controller_is_told_in_slow_rows(alpha, every, value):
    true = record(alpha, [{"name": "control_delay", "delay_s": 25.0}])
    (told,) = diagnose(stored(true, every, value, ("inflow",)), alpha, only=CONTROLLER).effects
    assert told.name == "control_delay"
    assert told.parameters["delay_s"].value == pytest.approx(25.0, abs=4.0)


@pytest.mark.parametrize(
    ("channel", "deadband", "every"),
    [
        ("level_m", 0.06, 10),
        pytest.param("level_m", 0.15, 30, marks=pytest.mark.long),
        pytest.param("head_m", 1.5, 10, marks=pytest.mark.long),
        pytest.param("flow_m3h", 12.0, 30, marks=pytest.mark.long),
    ],
)
def test_a_deadband_is_told_in_slow_rows_and_no_lag_beside_it(alpha, channel, deadband, every):
    true = record(alpha, [{"name": "report_by_exception", "channel": channel, "deadband": deadband}])
    (told,) = diagnose(stored(true, every, without=("inflow",)), alpha).effects
    assert (told.name, told.parameters["channel"].value) == ("report_by_exception", channel)
    low, high = told.parameters["deadband"].ci
    assert low <= deadband <= high


@pytest.mark.parametrize("every", [300, 900])
def test_rows_that_show_nothing_are_refused(alpha, plain, every):
    with pytest.raises(ValueError, match=f"rows of {every} s hide whole cycles of the wet well"):
        diagnose(stored(plain, every), alpha)


def test_what_cannot_be_shown_is_listed_with_the_reason(alpha, plain):
    report = diagnose(stored(plain, 180, without=("inflow", "head")), alpha).report()
    reasons = {one.effect: one.reason for one in report.not_tested}
    assert reasons["head_sensor_offset"] == "head is not measured"
    assert reasons["threshold_shift"] == "rows of 180 s do not show the level at which a pump was switched"
    assert "friction_bias" not in reasons
    assert {one.name for one in report.candidates}.isdisjoint(reasons)


@pytest.mark.long
@pytest.mark.parametrize(("every", "value"), [(1, "instant"), (900, "mean")])
def test_an_inflow_beside_a_meter_is_not_tested_where_there_is_no_meter(alpha, plain, every, value):
    report = diagnose(stored(plain, every, value, ("inflow",)), alpha).report()
    reasons = {one.effect: one.reason for one in report.not_tested}
    assert reasons["unmetered_inflow"] == "the inflow is not measured: the level follows it, whatever comes"


def test_a_recording_of_each_second_shows_all_but_what_never_happens(alpha, plain):
    reasons = {one.effect: one.reason for one in diagnose(plain, alpha).report().not_tested}
    assert set(reasons) <= {"common_header"}


def test_a_replay_stands_for_what_the_rows_do(alpha, plain, tmp_path):
    means = stored(plain, 60, "mean")
    write_recording(means, tmp_path / "means.parquet")
    replay_file(alpha, tmp_path / "means.parquet", tmp_path / "replay.parquet", closed_loop=False)
    predicted = read_recording(tmp_path / "replay.parquet")
    assert (predicted.value, len(predicted)) == ("mean", len(means))
    for name in ("pump1_flow_m3h", "pump1_frequency_hz", "level_m"):
        error = np.abs(predicted.column(name) - means.column(name))
        assert np.median(error) < 0.02 * np.ptp(means.column(name)), name


def test_too_few_rows_and_no_signal_are_refused_in_one_line(alpha, plain):
    hourly = stored(plain, 3600)
    with pytest.raises(ValueError, match="more slowly than every 900 s"):
        traces_of(hourly, alpha)
    blind = stored(plain, 10, without=("flow", "head", "power", "level"))
    with pytest.raises(ValueError, match="flow, head, power and level have no values"):
        traces_of(blind, alpha)
