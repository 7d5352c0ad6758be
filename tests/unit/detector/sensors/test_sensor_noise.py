"""Sensors that have grown noisy, told from their readings."""

import math

import numpy as np
import pytest

from wetwell.detector.sensors.sensor_noise import NOISY_FACTOR, healthy_noise, noisy_sensors, reading_noise

NAN = math.nan


def noisy_run(run_of, segments_of, rng, *, flow=0.01, head=0.01, drift=0.0):
    samples = 250
    return run_of(
        segments_of(np.zeros((10, 2))),
        flow_m3h=200.0 * (1.0 + flow * rng.normal(size=samples) + np.linspace(0.0, drift, samples)),
        head_m=26.0 * (1.0 + head * rng.normal(size=samples)),
    )


def test_noise_is_measured_as_a_share_and_a_drift_does_not_count(run_of, segments_of):
    rng = np.random.default_rng(2)
    found = [reading_noise(noisy_run(run_of, segments_of, rng, flow=0.02, head=0.005)) for _ in range(40)]
    np.testing.assert_allclose(np.mean(found, axis=0), [0.02, 0.005], rtol=0.05)
    drifting = reading_noise(noisy_run(run_of, segments_of, rng, drift=-0.3))
    np.testing.assert_allclose(drifting, 0.01, rtol=0.3)


def test_a_step_within_a_run_is_no_noise(run_of, segments_of):
    rng = np.random.default_rng(3)
    run = noisy_run(run_of, segments_of, rng)
    run.flow_m3h[100:] *= 0.6
    assert reading_noise(run)[0] == pytest.approx(0.0125, rel=0.4)


def test_only_the_meter_that_has_grown_noisy_is_told(run_of, segments_of):
    rng = np.random.default_rng(4)
    healthy = healthy_noise([reading_noise(noisy_run(run_of, segments_of, rng)) for _ in range(12)])
    for _ in range(20):
        assert noisy_sensors(noisy_run(run_of, segments_of, rng, head=0.02, flow=0.02), healthy) == {}
        told = noisy_sensors(noisy_run(run_of, segments_of, rng, head=0.05), healthy)
        assert list(told) == ["head_m"]
        assert told["head_m"] == pytest.approx(5.0, rel=0.35)
        assert told["head_m"] > NOISY_FACTOR
        assert list(noisy_sensors(noisy_run(run_of, segments_of, rng, flow=0.05), healthy)) == ["flow_m3h"]


def test_a_short_run_or_one_with_gaps_tells_no_noise(run_of, segments_of):
    short = run_of(segments_of(np.zeros((1, 2))))
    assert np.isnan(reading_noise(short)).all()
    sparse = noisy_run(run_of, segments_of, np.random.default_rng(5))
    sparse.time_s[:] *= 5.0
    assert np.isnan(reading_noise(sparse)).all()
    assert noisy_sensors(short, np.array([0.01, 0.01])) == {}


def test_noise_that_was_never_known_blames_nobody(run_of, segments_of):
    unknown = healthy_noise([np.full(2, NAN)] * 5)
    assert np.isnan(unknown).all()
    assert noisy_sensors(noisy_run(run_of, segments_of, np.random.default_rng(6), head=0.5), unknown) == {}
