"""Replay of a level of which only changes are sent: without an inflow meter the observer follows what is."""

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
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
