"""A level that is rounded is known when it passes from one step to the next: it is midway then."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.level_noise import told_by_steps_m
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.replay.steps import between_steps_m, steps_m
from wetwell.sim2real.residuals.bins import LEVEL, START_LEVEL, STOP_LEVEL
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.sim2real.truth.storage import Storage, stored
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

FROM_S = 3_600
"""The observer knows the inflow from then on."""
SECONDS = 43_200


@pytest.fixture(scope="module")
def recording(alpha):
    return Simulation(alpha, Scenario(name="plain"), 7, 0).advance(SECONDS)


def rounded(recording, station, quantum_m, *, is_metered=True):
    traces = traces_of(recording, station)
    level_m = np.round(traces.level_m / quantum_m) * quantum_m
    return replace(traces, level_m=level_m, inflow_m3h=traces.inflow_m3h if is_metered else None)


@pytest.mark.parametrize("noise_m", [0.0, 0.001, 0.004, 0.008])
@pytest.mark.parametrize("rate_m_s", [0.00031, -0.0021, 0.0147])
def test_a_level_that_moves_evenly_is_told_without_a_bias(noise_m, rate_m_s):
    true_m = 2.0 + rate_m_s * np.arange(round(1.0 / abs(rate_m_s)))
    reading_m = true_m + noise_m * np.random.default_rng(3).standard_normal(true_m.size)
    told_m = steps_m(np.round(reading_m / 0.02) * 0.02)
    error_m = (told_m - true_m)[np.isfinite(told_m)]
    assert np.abs(error_m.mean()) < 3.0 * error_m.std() / np.sqrt(error_m.size) + 1e-4
    assert error_m.std() < 1.4 * max(noise_m, 0.5 * abs(rate_m_s))


def test_a_level_that_turns_within_a_step_passes_it_twice():
    reading_m = np.r_[np.full(30, 1.0), 1.1, 1.0, np.full(20, 1.1), 1.0, np.full(30, 1.0)]
    told_m = steps_m(reading_m)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(told_m)), [31, 52])
    np.testing.assert_allclose(told_m[[31, 52]], 1.05)


@pytest.mark.parametrize(("away_s", "told_s"), [(100, [30, 60, 160, 180, 220]), (15, [30, 77, 135])])
def test_a_level_that_was_away_meanwhile_passes_a_step_three_times(away_s, told_s):
    """Else its passages there are one, in the mean of their seconds."""
    levels_m, for_s = (1.2, 1.1, 1.0, 1.1, 1.0, 0.9), (30, 30, away_s, 20, 40, 30)
    told_m = steps_m(np.repeat(levels_m, for_s))
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(told_m)), told_s)


def test_a_level_without_a_change_tells_nothing():
    assert np.isnan(steps_m(np.array([1.0, np.nan, 1.0]))).all()


@pytest.mark.parametrize(
    ("is_metered", "quantum_m", "most_m"),
    [(True, 0.015, 0.0005), (True, 0.06, 0.001), (False, 0.015, 0.004), (False, 0.06, 0.008)],
)
def test_a_rounded_level_is_followed_closer_than_its_steps(recording, alpha, is_metered, quantum_m, most_m):
    replay = Replay(rounded(recording, alpha, quantum_m, is_metered=is_metered), alpha)
    assert replay.observer.is_of_steps
    error_m = (replay.run().level_m - recording.truth["truth_level_m"])[FROM_S:]
    assert np.sqrt(np.mean(error_m**2)) < most_m


@pytest.mark.parametrize(
    ("quantum_m", "is_told_by_steps"), [(0.001, False), (0.003, False), (0.01, True), (0.03, True)]
)
def test_steps_count_where_noise_does_not_hide_them(recording, alpha, quantum_m, is_told_by_steps):
    """The noise of the level is 2 mm."""
    told_m = told_by_steps_m(rounded(recording, alpha, quantum_m))
    assert (told_m is not None) == is_told_by_steps


def test_a_level_that_is_held_or_comes_in_slow_rows_is_not_told_by_steps(recording, alpha):
    holding = EFFECTS["report_by_exception"](channel="level_m", deadband=0.05)
    station = alpha.model_copy(update={"effect": (holding,)})
    held = Simulation(station, Scenario(name="plain"), 7, 0).advance(SECONDS, truth=False)
    assert told_by_steps_m(rounded(held, alpha, 0.01)) is None
    slow = traces_of(stored(recording, Storage(every_s=20, step={"level_m": 0.01})), alpha)
    assert told_by_steps_m(slow) is None


@pytest.mark.parametrize("quantum_m", [0.01, 0.03])
def test_what_is_left_of_a_rounded_level_is_its_noise(recording, alpha, quantum_m):
    traces = rounded(recording, alpha, quantum_m, is_metered=False)
    replay, regimes = Replay(traces, alpha), regimes_of(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes, replay.run(), replay.doubt)
    its = residuals.bins.signal == LEVEL
    left = residuals.of(replay.run())[its]
    assert np.isfinite(steps_m(traces.level_m))[residuals.bins.second[its]].all()
    assert 0.4 < np.sqrt(np.mean(left**2)) < 1.2


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.7])
def test_between_its_steps_a_level_turns_where_it_turned(phase):
    time_s = np.arange(2_000.0)
    true_m = 1.0 + phase * 0.02 + np.abs(np.remainder(time_s / 400.0, 2.0) - 1.0)  # up and down by 1 m in 400 s
    between_m = between_steps_m(steps_m(np.round(true_m / 0.02) * 0.02))
    np.testing.assert_allclose(between_m[100:1_900], true_m[100:1_900], atol=0.004)


def test_too_few_passages_have_nothing_between_them():
    assert np.isnan(between_steps_m(np.array([np.nan, 1.0, 1.1, 1.2, np.nan]))).all()


@pytest.mark.parametrize("cut", [np.round, np.floor, np.ceil])
def test_the_level_of_an_event_is_known_within_its_steps_however_they_are_cut(recording, alpha, cut):
    """Thresholds of alpha are told to some millimetres, in steps of 3 cm."""
    traces = traces_of(recording, alpha)
    traces = replace(traces, level_m=cut(traces.level_m / 0.03) * 0.03)
    replay, regimes = Replay(traces, alpha), regimes_of(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes, replay.run(), replay.doubt)
    is_event = np.isin(residuals.bins.signal, (START_LEVEL, STOP_LEVEL))
    off_m = (residuals.of(replay.run()) * residuals.bins.deviation)[is_event]
    assert is_event.sum() > 100
    assert np.abs(np.median(off_m)) < 0.003
    shifted = EFFECTS["threshold_shift"](start_m=0.05, stop_m=-0.05)
    shift_m = (residuals.of(replay.run([shifted])) * residuals.bins.deviation)[is_event]
    assert np.mean(np.abs(shift_m)) == pytest.approx(0.05, abs=0.004)


@pytest.mark.parametrize(("is_metered", "most_m"), [(True, 0.004), (False, 0.015)])
def test_a_large_wet_well_is_not_lost_between_its_steps(alpha, is_metered, most_m):
    """Its level takes many minutes from one step to the next; an outage of an hour is one."""
    station = alpha.model_copy(update={"sump": alpha.sump.model_copy(update={"area_m2": 200.0})})
    traces = traces_of(Simulation(station, Scenario(name="plain"), 7, 0).advance(6 * SECONDS, truth=False), station)
    level_m = np.round(traces.level_m / 0.05) * 0.05
    level_m[60_000:63_600] = np.nan
    replay = Replay(replace(traces, level_m=level_m, inflow_m3h=traces.inflow_m3h if is_metered else None), station)
    told_s = np.flatnonzero(np.isfinite(replay.observer.level_m))
    pauses_s, begins = np.diff(told_s), replay.observer.level_gain[told_s[1:]] == 1.0
    assert np.sum(pauses_s > 300) > 30
    assert (begins == (pauses_s >= 3_600)).all()
    off_m = (replay.observer.level_m - replay.run().level_m)[told_s[1:]]
    assert np.sqrt(np.mean(off_m[~begins] ** 2)) < most_m
