"""Replay of a level that comes late: nobody measures the inflow, so that the observer follows the level closely."""

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

DELAY_S = 19.6
FROM_S = 3_600
"""The observer knows the inflow from then on."""


@pytest.fixture(scope="module")
def replay(alpha):
    late = EffectTable(name="channel_delay", channel="level_m", delay_s=DELAY_S)
    station = alpha.model_copy(update={"effect": (late,)})
    recording = Simulation(station, Scenario(name="plain"), 7, 0).advance(14_400, truth=False)
    columns = {name: values for name, values in recording.columns.items() if name != "inflow_m3h"}
    return Replay(traces_of(type(recording)(time_ns=recording.time_ns, columns=columns), alpha), alpha)


def errors_m(replay, delay_s):
    effect = EFFECTS["channel_delay"](channel="level_m", delay_s=delay_s)
    return (replay.traces.level_m - replay.run([effect]).level_m)[FROM_S:]


@pytest.mark.parametrize("delay_s", [0.0, 10.0, DELAY_S, 60.0])
def test_whatever_delay_is_tried_the_observer_does_not_swing(replay, alpha, delay_s):
    """A level that is taken for late by 40 s moves by less than 40 s of the fastest filling and emptying."""
    fastest_m_s = np.max(np.abs(np.diff(replay.traces.level_m[::60]))) / 60.0
    assert np.max(np.abs(errors_m(replay, delay_s))) < 45.0 * fastest_m_s + 5.0 * alpha.sensors.level_noise_m


def test_what_the_true_delay_leaves_is_noise(replay, alpha):
    assert np.std(errors_m(replay, DELAY_S)) < 1.5 * alpha.sensors.level_noise_m
