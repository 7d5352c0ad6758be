"""Kalman's filter of a level under a sensor that lags."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from wetwell.sim2real.replay.level_filter import Uncertain, level_filter
from wetwell.simulator.parameters import SensorParameters
from wetwell.simulator.telemetry.damping import damped_by

SENSOR = SensorParameters(correlation=0.0)
SECONDS = 4000
UNCERTAIN = Uncertain(
    is_known=np.ones(SECONDS, dtype=bool),
    open_m2=np.zeros(SECONDS),
    noise_m2=4e-6,
    drift_m2_s3=1e-8,
    waves_m2_s=1e-7,
    first_m2_s2=1e-6,
    metered_m2_s2=0.0,
    lost_s=300.0,
    least_gain=0.0,
)


@pytest.mark.parametrize(("lag_s", "second_share"), [(0.0, 0.0), (5.0, 0.0), (29.0, 0.0), (29.0, 0.4)])
def test_gains_settle_at_those_of_the_riccati_equation(lag_s, second_share):
    """Against scipy, with the lag as two filters of what comes in, which moves evenly over a second."""
    sensor = damped_by(SENSOR, lag_s, second_share)
    first_s, second_s = (1.0 - second_share) * lag_s, second_share * lag_s
    rates = np.zeros((4, 4))  # of the level, how fast it moves, and both filters
    rates[0, 1] = 1.0
    if lag_s > 0.0:
        rates[2, [0, 2]] = 1.0 / first_s, -1.0 / first_s
    if second_s > 0.0:
        rates[3, [2, 3]] = 1.0 / second_s, -1.0 / second_s
    step = linalg.expm(rates)
    if lag_s == 0.0:
        step[2] = [1.0, 1.0, 0.0, 0.0]
    if second_s == 0.0:
        step[3] = step[2]
    follows, inflow = step[:, 1].copy(), np.array([0.0, 1.0, 0.0, 0.0])
    follows[1] = 0.0
    through = np.column_stack([follows, inflow])
    of_inflow = 1e-8 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]) + np.diag([1e-7, 0.0])
    wandering = through @ of_inflow @ through.T
    seen = np.array([[0.0], [0.0], [0.0], [1.0]])
    before = linalg.solve_discrete_are(step.T, seen, wandering + 1e-22 * np.eye(4), np.array([[4e-6]]))
    gains, variance_m2 = level_filter(UNCERTAIN, sensor)
    assert variance_m2[-1] == pytest.approx(before[3, 3] + 4e-6, rel=1e-6)
    assert gains[:, -1] == pytest.approx(before[:, 3] / (before[3, 3] + 4e-6), rel=1e-5)


def test_rows_of_a_minute_are_those_of_the_continuous_model():
    """Without a lag, against the two states that go from row to row at once."""
    rows = np.arange(SECONDS) % 60 == 59
    gains, variance_m2 = level_filter(replace(UNCERTAIN, is_known=rows), SENSOR)
    step, drift, waves = 60.0, 1e-8, 1e-7
    move = np.array([[1.0, step], [0.0, 1.0]])
    wandering = drift * np.array([[step**3 / 3.0, step**2 / 2.0], [step**2 / 2.0, step]])
    wandering[0, 0] += waves * step
    before = linalg.solve_discrete_are(move.T, np.array([[1.0], [0.0]]), wandering, np.array([[4e-6]]))
    last = np.flatnonzero(rows)[-1]
    assert variance_m2[last] == pytest.approx(before[0, 0] + 4e-6, rel=1e-6)
    assert gains[:2, last] == pytest.approx(before[:, 0] / (before[0, 0] + 4e-6), rel=1e-6)
    assert gains[2:, last] == pytest.approx([gains[0, last]] * 2)
    assert np.isnan(variance_m2[~rows]).all()


def test_an_error_of_a_meter_that_goes_over_is_followed_as_the_riccati_equation_says():
    """Against scipy, from second to second."""
    kept, error = 0.99, 1e-8
    meter = replace(UNCERTAIN, drift_m2_s3=error * (1.0 - kept**2), first_m2_s2=error, inflow_kept=kept)
    gains, variance_m2 = level_filter(meter, SENSOR)
    step = np.array([[1.0, 1.0], [0.0, kept]])
    wandering = error * (1.0 - kept**2) * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]) + np.diag([1e-7, 0.0])
    before = linalg.solve_discrete_are(step.T, np.array([[1.0], [0.0]]), wandering, np.array([[4e-6]]))
    assert variance_m2[-1] == pytest.approx(before[0, 0] + 4e-6, rel=1e-6)
    assert gains[:2, -1] == pytest.approx(before[:, 0] / (before[0, 0] + 4e-6), rel=1e-5)


def test_a_level_behind_a_lag_is_moved_by_more_than_its_reading():
    gains, _ = level_filter(UNCERTAIN, damped_by(SENSOR, 29.0, 0.0))
    assert gains[0, -1] > gains[3, -1] > 0.0


def test_after_a_pause_all_begins_anew():
    is_known = np.ones(SECONDS, dtype=bool)
    is_known[1000:1500] = False
    gains, _ = level_filter(replace(UNCERTAIN, is_known=is_known), damped_by(SENSOR, 29.0, 0.0))
    assert np.flatnonzero(gains[3] == 1.0).tolist() == [0, 1500]
    assert gains[1, 1500] == 0.0
    assert not gains[:, 1000:1500].any()
