"""What the level shows of an error of the balance, with and without a meter of the inflow."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.sim2real.recording.regimes import IDLE, STEADY, STOP_RAMP, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.level import level_residuals
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

FROM_S = 3_600
"""The observer knows the inflow from then on."""


@pytest.fixture(scope="module")
def metered(alpha):
    return traces_of(Simulation(alpha, Scenario(name="plain"), 7, 0).advance(14_400, truth=False), alpha)


@pytest.fixture(scope="module")
def unmetered(metered):
    return replace(metered, inflow_m3h=None)


def level_bins(traces, station):
    replay = Replay(traces, station)
    return level_residuals(
        traces, station, regimes_of(traces, station), replay.run(), replay.doubt(is_level_held=False), {}
    ).bins


def test_what_an_error_of_the_balance_leaves_is_what_the_kernel_makes_of_it(unmetered, alpha):
    """A wet well that is larger by a hundredth: the level moves by as much less, whatever moves it."""
    replay = Replay(unmetered, alpha)
    sump = alpha.sump.model_copy(update={"area_m2": 1.01 * alpha.sump.area_m2})
    larger = Replay(unmetered, alpha.model_copy(update={"sump": sump}))
    larger.observer = replay.observer
    plain = replay.run()
    moved_m = (larger.run().level_m - plain.level_m)[FROM_S:]
    carried_m_s = plain.signals["flow_m3h"].sum(axis=0) / 3600.0 / alpha.sump.area_m2
    left_m = replay.observer.left_m(0.01 * carried_m_s, np.zeros(carried_m_s.size))[FROM_S:]
    assert np.corrcoef(moved_m, left_m)[0, 1] > 0.95
    assert np.std(left_m) == pytest.approx(np.std(moved_m), rel=0.2)


def test_without_a_meter_what_is_material_is_what_the_observer_leaves_of_it(metered, unmetered, alpha):
    with_meter, without = level_bins(metered, alpha), level_bins(unmetered, alpha)
    size_m = without.material * without.deviation
    is_late = without.second > FROM_S
    steady, stops = (np.isin(without.regime, regimes) & is_late for regimes in ((IDLE, STEADY), (STOP_RAMP,)))
    assert np.median(size_m[steady]) < 0.1 * np.median(with_meter.material * with_meter.deviation)
    assert np.median(size_m[stops]) > 3.0 * np.median(size_m[steady])
    assert np.max(size_m) < 2.0 * alpha.materiality.level_m + alpha.materiality.time_s * 0.01
    assert np.all(size_m > 0.0)
