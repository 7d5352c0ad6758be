"""Channels that are held, from their values alone."""

import numpy as np
import pytest

from wetwell.services.stations import find_scenario
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.residuals.phases import phase
from wetwell.sim2real.residuals.telemetry import telemetry_residuals
from wetwell.simulator.simulation import Simulation

NAMES = [f"pump{i}_power_kw" for i in (1, 2, 3)]


def held(values, deadband, report_s, pause_s=0):
    """What is sent of values: after a move by a deadband, or a time, and not again for a pause."""
    sent, since = values.copy(), 0
    for row in range(1, values.size):
        since += 1
        if (abs(values[row] - sent[row - 1]) >= deadband and since > pause_s) or since >= report_s:
            since = 0
        else:
            sent[row] = sent[row - 1]
    return sent


@pytest.fixture(scope="module", params=[1.0, 2.0, 6.0])
def recorded(request, alpha):
    station = alpha.model_copy(update={"control": alpha.control.model_copy(update={"ramp_s": request.param})})
    return station, Simulation(station, find_scenario("nominal"), 3).advance(21_600, truth=False)


def patterns(station, recording, **changed):
    columns = recording.columns | changed
    traces = traces_of(type(recording)(time_ns=recording.time_ns, columns=columns), station)
    return telemetry_residuals(traces, station, regimes_of(traces, station)).patterns


def test_noise_and_a_meter_that_is_stuck_are_not_held(recorded):
    station, recording = recorded
    stuck = {name: np.where(recording.columns[name] > 0.0, 17.0, 0.0) for name in NAMES}
    assert patterns(*recorded) == patterns(station, recording, **stuck) == ()


@pytest.mark.parametrize("report_s", [240, 1000])
def test_a_deadband_that_only_time_and_ramps_pass_is_at_least_what_time_moved(recorded, report_s):
    station, recording = recorded
    found = patterns(station, recording, **{name: held(recording.columns[name], 3.0, report_s) for name in NAMES})
    for pattern in found:
        assert pattern.quantity == "power_kw"
        assert pattern.missed(3.0) == 0.0
        assert pattern.missed(0.0) > 0.0
    assert len(found) == 1 or report_s > 240


def test_a_deadband_is_seen_though_what_time_sends_is_stored_in_steps_that_large(recorded):
    station, recording = recorded
    coarse = {name: np.round(held(recording.columns[name], 3.0, 120) / 0.2) * 0.2 for name in NAMES}
    (found,) = patterns(station, recording, **coarse)
    assert found.quantity == "power_kw"
    assert found.missed(3.0) == 0.0
    assert found.missed(0.0) > 0.0


def test_a_deadband_that_noise_passes_is_known_to_a_few_percent(recorded):
    station, recording = recorded
    (found,) = patterns(station, recording, **{name: held(recording.columns[name], 0.25, 10**6) for name in NAMES})
    assert found.deadband == pytest.approx(0.25, rel=0.05)
    assert found.missed(0.3) > 0.0


@pytest.mark.parametrize("pause_s", [0, 2])
def test_a_pause_after_each_value_is_seen_in_ramps(recorded, pause_s):
    station, recording = recorded
    (found,) = patterns(station, recording, **{n: held(recording.columns[n], 0.25, 10**6, pause_s) for n in NAMES})
    assert found.pause_s == pause_s


@pytest.mark.parametrize(("step_m", "is_told"), [(0.005, False), (0.01, False), (0.02, True)])
def test_a_level_that_is_stored_to_a_centimetre_is_no_gap(recorded, step_m, is_told):
    station, recording = recorded
    columns = recording.columns | {"level_m": np.round(recording.columns["level_m"] / step_m) * step_m}
    traces = traces_of(type(recording)(time_ns=recording.time_ns, columns=columns), station)
    telemetry = telemetry_residuals(traces, station, regimes_of(traces, station))
    (pattern,) = telemetry.patterns
    assert pattern.quantum == pytest.approx(step_m, rel=0.05)
    assert telemetry.components(()) == ({"level_m": "level_sensor"} if is_told else {})
    assert telemetry.components(["level_quantisation"]) == {}, "it is known what makes it"
    assert pattern.rounding(0.0) == (0.0 if is_told else pattern.quantum), "a usual step is excused in any case"
    assert bool(telemetry.bins.size) == is_told


def test_each_pattern_is_in_a_group_of_its_own(recorded):
    """In one group the deadband of a head explained the steps of a level, and these were never told."""
    station, recording = recorded
    columns = recording.columns | {"level_m": np.round(recording.columns["level_m"] / 0.02) * 0.02}
    columns |= {name: held(recording.columns[name], 0.5, 10**6, 0) for name in NAMES}
    traces = traces_of(type(recording)(time_ns=recording.time_ns, columns=columns), station)
    telemetry = telemetry_residuals(traces, station, regimes_of(traces, station))
    assert [pattern.effect for pattern in telemetry.patterns] == ["level_quantisation", "report_by_exception"]
    spans = phase(telemetry.bins).reshape(2, -1)
    assert [np.unique(span).tolist() for span in spans] == [[0], [1]]


@pytest.mark.parametrize(
    ("quantum", "stored"),
    [
        (0.0408, 0.01),
        (0.0217, 0.01),
        (0.0192, 0.01),
        (0.0152, 0.01),
        (0.0131, 0.01),
        (0.0293, 0.01),
        (0.0337, 0.001),
        (0.027, 0.0),
    ],
)
def test_a_coarse_level_is_told_from_a_held_one_whatever_it_was_stored_in(recorded, quantum, stored):
    station, recording = recorded
    coarse = quantum * np.floor(recording.columns["level_m"] / quantum)
    (found,) = patterns(station, recording, level_m=stored * np.round(coarse / stored) if stored else coarse)
    assert found.deadband == 0.0
    assert found.quantum == pytest.approx(quantum, rel=0.02)


def test_a_held_level_is_no_coarse_one_in_whatever_it_was_stored(recorded):
    station, recording = recorded
    level_m = 0.01 * np.round(held(recording.columns["level_m"], 0.06, 10**6) / 0.01)
    assert all(pattern.quantum <= 0.01 + 1e-9 for pattern in patterns(station, recording, level_m=level_m))


@pytest.mark.parametrize("deadband_m", [0.0489, 0.06, 0.09])
def test_a_held_level_is_seen_though_it_is_stored_to_a_centimetre(recorded, deadband_m):
    """Its moves are whole centimetres, so that the deadband is known to one."""
    station, recording = recorded
    level_m = 0.01 * np.round(held(recording.columns["level_m"], deadband_m, 900) / 0.01)
    found = [one for one in patterns(station, recording, level_m=level_m) if one.deadband > 0.0]
    assert [one.quantity for one in found] == ["level_m"]
    assert found[0].missed(deadband_m) == 0.0
    assert min(found[0].missed(0.0), found[0].missed(2.0 * deadband_m)) > 0.0


def in_rows(recording, every):
    columns = {name: values[::every] for name, values in recording.columns.items()}
    return type(recording)(time_ns=recording.time_ns[::every], columns=columns)


@pytest.mark.parametrize("stored", [0.0, 0.01])
def test_a_deadband_is_seen_in_rows_that_lie_apart(recorded, stored):
    station, recording = recorded
    level_m = held(recording.columns["level_m"], 0.06, 900)
    level_m = stored * np.round(level_m / stored) if stored else level_m
    found = patterns(station, in_rows(recording, 10), level_m=level_m[::10])
    (pattern,) = (one for one in found if one.deadband > 0.0)
    assert (pattern.quantity, pattern.pause_s) == ("level_m", 0)
    assert pattern.missed(0.06) == 0.0
    assert min(pattern.missed(0.04), pattern.missed(0.09)) > 0.0


def test_a_deadband_that_ramps_alone_pass_lies_under_them_in_rows_too(recorded):
    station, recording = recorded
    rows = in_rows(recording, 10)
    found = patterns(station, rows, **{name: held(recording.columns[name], 3.0, 10**6)[::10] for name in NAMES})
    assert all((one.quantity, one.missed(3.0), one.missed(0.1) > 0.0) == ("power_kw", 0.0, True) for one in found)
    assert len(found) == (station.control.ramp_s > 2.0), "rows of 10 s pass over ramps of a second or two"


@pytest.mark.parametrize("every", [10, 30])
@pytest.mark.parametrize("anew_s", [30, 60, 120])
def test_values_that_are_read_anew_at_times_are_not_held_by_a_deadband(recorded, every, anew_s):
    station, recording = recorded
    seconds = np.arange(len(recording))
    readings = {n: v for n, v in recording.columns.items() if not n.endswith(("hz", "running"))}
    old = {name: values[seconds - seconds % anew_s][::every] for name, values in readings.items()}
    assert patterns(station, in_rows(recording, every), **old) == ()


@pytest.mark.parametrize("every", [10, 60])
@pytest.mark.parametrize("step", [0.1, 0.5, 2.0])
def test_noise_and_rounding_are_not_held_in_rows(recorded, every, step):
    station, recording = recorded
    rounded = {name: step * np.round(recording.columns[name] / step)[::every] for name in NAMES}
    assert patterns(station, in_rows(recording, every)) == ()
    assert patterns(station, in_rows(recording, every), **rounded) == ()


def test_a_level_that_is_rounded_and_fills_slowly_is_not_held_in_rows(recorded):
    """Most of its values repeat, and pumps move it by several steps from row to row."""
    station, recording = recorded
    level_m = np.r_[np.linspace(0.5, 1.6, 21_000), np.linspace(1.6, 0.5, 600)]
    level_m = 0.01 * np.round(level_m[: len(recording)] / 0.01)
    found = patterns(station, in_rows(recording, 30), level_m=level_m[::30])
    assert all(one.deadband == 0.0 for one in found)
