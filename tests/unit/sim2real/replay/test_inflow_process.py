"""How an inflow that nobody measures moves, learnt from a level at rest."""

import numpy as np
import pytest
from scipy.signal import lfilter

from wetwell.sim2real.replay.inflow_process import DRIFT, MOST_S, learnt_process
from wetwell.sim2real.replay.level_filter import Uncertain
from wetwell.simulator.parameters import SensorParameters

SECONDS = 40_000
CYCLE_S, REST_S = 1000, 700
SENSOR = SensorParameters(correlation=0.0)
CARRIED_M_S = 0.007
DRIFT_M2_S3, WAVES_M2_S, NOISE_M = 1e-9, 1.5e-6, 0.002


def learnt(lag_s, every_s=1, waves_m2_s=WAVES_M2_S, seconds=SECONDS, seed=4):
    """What is learnt of a level that rises and is pumped down in turns."""
    rng = np.random.default_rng(seed)
    place = np.arange(seconds)
    is_idle = place % CYCLE_S < REST_S
    inflow_m_s = 0.002 + np.cumsum(np.sqrt(DRIFT_M2_S3) * rng.standard_normal(seconds))
    waves_m = np.sqrt(waves_m2_s) * rng.standard_normal(seconds)
    level_m = np.cumsum(inflow_m_s + waves_m - np.where(is_idle, 0.0, CARRIED_M_S))
    if lag_s > 0.0:
        left = np.exp(-1.0 / lag_s)
        level_m = lfilter([1.0 - left], [1.0, -left], level_m)
    level_m = level_m + NOISE_M * rng.standard_normal(seconds)
    uncertain = Uncertain(
        is_known=place % every_s == 0,
        open_m2=np.zeros(seconds),
        noise_m2=NOISE_M**2,
        drift_m2_s3=0.0,
        waves_m2_s=0.0,
        first_m2_s2=0.003**2,
        metered_m2_s2=0.0,
        lost_s=300.0,
        least_gain=0.0,
    )
    level_m = np.where(uncertain.is_known, level_m, np.nan)
    is_settled = is_idle & (place % CYCLE_S > 0.5 * REST_S)
    return uncertain, learnt_process(uncertain, level_m, is_idle, is_settled, SENSOR, CARRIED_M_S, float(every_s))


@pytest.mark.parametrize(("lag_s", "every_s"), [(0.0, 1), (12.0, 1), (30.0, 1), (0.0, 10)])
def test_it_is_found_under_the_lag_that_the_sensor_has(lag_s, every_s):
    _, process = learnt(lag_s, every_s)
    found = process.at(max(lag_s - 0.5, 0.0))
    assert found.waves_m2_s == pytest.approx(WAVES_M2_S, rel=0.4)
    assert found.drift_m2_s3 == pytest.approx(DRIFT_M2_S3, rel=0.4)


def test_a_lag_that_cannot_be_has_no_process_of_its_own():
    """An inflow that is anew in each second shows in the bends of the level, unless its sensor lags."""
    _, process = learnt(0.0)
    assert process.lags_s == (0.0,)


def test_an_inflow_without_waves_may_have_some_that_a_lag_hides():
    _, process = learnt(0.0, waves_m2_s=0.0)
    assert process.at(0.0).waves_m2_s < 0.02 * WAVES_M2_S < process.at(39.5).waves_m2_s
    assert process.at(39.5).waves_m2_s > process.at(30.0).waves_m2_s > process.at(10.0).waves_m2_s


def test_of_many_rests_some_are_enough():
    _, process = learnt(0.0, seconds=3 * MOST_S)
    assert process.at(0.0).waves_m2_s == pytest.approx(WAVES_M2_S, rel=0.3)


def test_nothing_but_the_process_is_another():
    given, process = learnt(0.0)
    found = process.at(0.0)
    assert found.is_known is given.is_known
    assert (found.noise_m2, found.first_m2_s2) == (given.noise_m2, given.first_m2_s2)


def test_where_nothing_rests_it_is_that_of_the_station():
    given, _ = learnt(0.0, seconds=2000)
    never = np.zeros(2000, dtype=bool)
    found = learnt_process(given, np.ones(2000), never, never, SENSOR, CARRIED_M_S, 1.0).at(0.0)
    assert (found.drift_m2_s3, found.waves_m2_s) == (DRIFT * CARRIED_M_S**2, 0.0)
