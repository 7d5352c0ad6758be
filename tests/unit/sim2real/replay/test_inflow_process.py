"""How an inflow that nobody measures moves, learnt from a level at rest."""

import numpy as np
import pytest
from scipy.signal import lfilter

from wetwell.sim2real.recording.seconds import noise_by_bends
from wetwell.sim2real.replay.inflow_process import DRIFT, MOST_S, inflow_bends, learnt_process
from wetwell.sim2real.replay.level_filter import Uncertain
from wetwell.simulator.parameters import SensorParameters
from wetwell.simulator.telemetry.damping import damped_by

SECONDS = 40_000
CYCLE_S, REST_S = 1000, 700
SENSOR = SensorParameters(correlation=0.0)
CARRIED_M_S = 0.007
DRIFT_M2_S3, WAVES_M2_S, NOISE_M = 1e-9, 1.5e-6, 0.002


def lagging(lag_s):
    return damped_by(SENSOR, lag_s, 0.0)


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
    bends_m, rests = np.diff(level_m[::every_s], n=2), is_idle[::every_s]
    uncertain = Uncertain(
        is_known=place % every_s == 0,
        open_m2=np.zeros(seconds),
        noise_m2=noise_by_bends(bends_m[rests[2:] & rests[:-2]]) ** 2,
        drift_m2_s3=0.0,
        waves_m2_s=0.0,
        first_m2_s2=0.003**2,
        metered_m2_s2=0.0,
        lost_s=300.0,
        least_gain=0.0,
    )
    level_m = np.where(uncertain.is_known, level_m, np.nan)
    is_settled = is_idle & (place % CYCLE_S > 0.5 * REST_S)
    process = learnt_process(uncertain, level_m, is_idle, is_settled, SENSOR, CARRIED_M_S, float(every_s), 1e-4)
    return uncertain, process


@pytest.mark.parametrize(("lag_s", "every_s"), [(0.0, 1), (12.0, 1), (30.0, 1), (0.0, 10)])
def test_it_is_found_under_the_lag_that_the_sensor_has(lag_s, every_s):
    _, process = learnt(lag_s, every_s)
    found = process.at(lagging(lag_s))
    assert found.waves_m2_s == pytest.approx(WAVES_M2_S, rel=0.4)
    assert found.drift_m2_s3 == pytest.approx(DRIFT_M2_S3, rel=0.4)
    assert found.noise_m2 == pytest.approx(NOISE_M**2, rel=0.4)


@pytest.mark.parametrize("every_s", [1, 10])
@pytest.mark.parametrize("seed", range(3))
def test_a_level_that_does_not_lag_is_never_known_to_lag(every_s, seed):
    """Waves of the inflow bend the level, too: taken for noise, they would look like what a sensor smooths."""
    _, process = learnt(0.0, every_s, waves_m2_s=4.0 * WAVES_M2_S, seconds=3 * SECONDS, seed=seed)
    assert process.lags_s[0] == 0.0


@pytest.mark.parametrize(("lag_s", "every_s"), [(0.0, 1), (0.0, 10), (7.0, 10)])
def test_bends_show_as_noise_what_the_inflow_makes_of_them(lag_s, every_s):
    rng, step_s = np.random.default_rng(8), 0.1
    moves = np.sqrt(step_s) * rng.normal(size=1_000_000)
    left = np.exp(-step_s / lag_s) if lag_s else 0.0
    shares = inflow_bends(damped_by(SENSOR, lag_s, 0.0), every_s)
    for level_m, expected in zip((np.cumsum(step_s * np.cumsum(moves)), np.cumsum(moves)), shares, strict=True):
        shown_m = lfilter([1.0 - left], [1.0, -left], level_m)[:: round(every_s / step_s)]
        assert np.var(np.diff(shown_m, n=2)) / 6.0 == pytest.approx(expected, rel=0.1)


def test_a_lag_that_cannot_be_has_no_process_of_its_own():
    """An inflow that is anew in each second shows in the bends of the level, unless its sensor lags."""
    _, process = learnt(0.0)
    assert process.lags_s == (0.0,)


@pytest.mark.parametrize("lag_s", [0.5, 2.0, 4.0])
def test_under_a_lag_the_inflow_makes_less_of_the_bends_and_the_sensor_more(lag_s):
    """Else the filter corrects too much, its errors cancel over half a minute, and a lag that is not there gains."""
    given, process = learnt(0.0, every_s=5)
    found, still = process.at(lagging(lag_s)), process.at(SENSOR)
    assert still.noise_m2 < found.noise_m2 < given.noise_m2
    shares = inflow_bends(lagging(lag_s), 5)
    made_m2 = float(shares @ (found.drift_m2_s3, found.waves_m2_s))
    assert found.noise_m2 + made_m2 == pytest.approx(given.noise_m2, rel=1e-9)


def test_an_inflow_without_waves_may_have_some_that_a_lag_hides():
    _, process = learnt(0.0, waves_m2_s=0.0)
    assert process.at(lagging(0.0)).waves_m2_s < 0.02 * WAVES_M2_S < process.at(lagging(40.0)).waves_m2_s
    assert (
        process.at(lagging(40.0)).waves_m2_s
        > process.at(lagging(30.0)).waves_m2_s
        > process.at(lagging(10.0)).waves_m2_s
    )


def test_of_many_rests_some_are_enough():
    _, process = learnt(0.0, seconds=3 * MOST_S)
    assert process.at(lagging(0.0)).waves_m2_s == pytest.approx(WAVES_M2_S, rel=0.3)


def test_nothing_but_the_process_is_another():
    given, process = learnt(0.0)
    found = process.at(lagging(0.0))
    assert found.is_known is given.is_known
    assert (found.first_m2_s2, found.lost_s) == (given.first_m2_s2, given.lost_s)


def test_where_nothing_rests_it_is_that_of_the_station():
    given, _ = learnt(0.0, seconds=2000)
    never = np.zeros(2000, dtype=bool)
    found = learnt_process(given, np.ones(2000), never, never, SENSOR, CARRIED_M_S, 1.0, 1e-4).at(lagging(0.0))
    assert (found.drift_m2_s3, found.waves_m2_s) == (DRIFT * CARRIED_M_S**2, 0.0)
