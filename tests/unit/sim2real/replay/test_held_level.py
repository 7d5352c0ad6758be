"""Replay of a level of which only changes are sent: without an inflow meter the observer follows what is."""

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.held import as_sent
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.truth.telemetry import by_exception
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

FROM_S = 7_200
"""The observer knows the inflow from then on."""


def replayed(alpha, deadband_m, *, has_inflow=False, begin_s=0, every=1):
    sent = EffectTable(name="report_by_exception", channel="level_m", deadband=deadband_m)
    simulation = Simulation(alpha.model_copy(update={"effect": (sent,)}), Scenario(name="plain"), 7, 0)
    recording = simulation.advance(21_600, truth=True)
    columns = {
        name: values[begin_s::every]
        for name, values in recording.columns.items()
        if has_inflow or name != "inflow_m3h"
    }
    replay = Replay(
        traces_of(type(recording)(time_ns=recording.time_ns[begin_s::every], columns=columns), alpha), alpha
    )
    return replay, recording.truth["truth_level_m"][begin_s:]


@pytest.mark.parametrize("deadband_m", [0.02, 0.08])
def test_between_what_is_sent_the_observer_does_not_swing(alpha, deadband_m):
    replay, true_m = replayed(alpha, deadband_m)
    effect = EFFECTS["report_by_exception"](channel="level_m", deadband=deadband_m)
    assert np.sqrt(np.mean((replay.run([effect]).level_m - true_m)[FROM_S:] ** 2)) < deadband_m


def test_nor_does_it_where_steps_are_taken_for_a_level_that_lags(alpha):
    """Steps make an inflow that nobody measures look wild; followed as closely through a lag it would swing."""
    replay, true_m = replayed(alpha, 0.04)
    lagging = replay.run([EFFECTS["level_sensor_lag"](lag_s=35.0, second_share=0.3)])
    assert np.max(np.abs(lagging.level_m - true_m)[FROM_S:]) < 0.5 * np.ptp(true_m)


@pytest.mark.parametrize("begin_s", [0, 30, 100])
def test_it_knows_the_level_from_the_first_value_that_was_sent_since_the_recording_began(alpha, begin_s):
    replay, true_m = replayed(alpha, 0.08, has_inflow=True, begin_s=begin_s)
    error_m = replay.run([EFFECTS["report_by_exception"](channel="level_m", deadband=0.08)]).level_m - true_m
    first_s = np.flatnonzero(np.diff(replay.traces.level_m))[0] + 1
    assert np.max(np.abs(error_m[:first_s])) < 0.08
    assert np.max(np.abs(error_m[first_s + 1 : first_s + 600])) < 0.02


@pytest.mark.parametrize("every", [1, 10])
def test_a_level_that_comes_late_begins_with_its_first_value(alpha, every):
    replay, true_m = replayed(alpha, 0.0, has_inflow=True, every=every)
    delayed = replay.run([EFFECTS["channel_delay"](channel="level_m", delay_s=20.0)])
    assert delayed.level_m[20] == pytest.approx(true_m[20], abs=0.08)


@pytest.mark.parametrize(("up_m_s", "down_m_s"), [(0.0013, 0.0043), (0.0009, 0.0067)])
def test_a_value_of_a_row_is_followed_when_it_was_sent(up_m_s, down_m_s):
    """A row tells of a value up to ten seconds late, and of less where the level moved by several deadbands since."""
    up_m = np.arange(0.5, 1.6, up_m_s)
    true_m = np.tile(np.r_[up_m, np.arange(1.6, 0.5, -down_m_s)], 20)
    rows_m = np.full(true_m.size, np.nan)
    rows_m[::10] = by_exception(true_m, 0.05, np.inf)[::10]
    sent_m = as_sent(rows_m, 10.0)
    told = np.flatnonzero(np.isfinite(sent_m))
    is_up = told % (true_m.size // 20) < up_m.size
    for way, slope_m_s in ((is_up, up_m_s), (~is_up, -down_m_s)):
        early_s = (sent_m - true_m)[told[way]] / slope_m_s
        assert abs(np.mean(early_s)) < 2.0
        assert np.quantile(np.abs(early_s), 0.9) < 5.5


def test_values_that_tell_of_no_deadband_stay_where_they_are():
    rows_m = np.full(1_000, np.nan)
    rows_m[::10] = np.random.default_rng(2).normal(size=100)
    sent_m = as_sent(rows_m, 10.0)
    np.testing.assert_array_equal(sent_m[10:], rows_m[10:])
