"""Figures of healthy runs that do without the curves."""

import math

import numpy as np
import pytest

from wetwell.detector.baseline.healthy_reference import CHECK_FLOOR, learn_check, log_power

NAN = math.nan


def test_a_check_is_learnt_from_the_middle_of_healthy_runs():
    rng = np.random.default_rng(3)
    values = [*(0.1 + 0.05 * rng.normal(size=200)), NAN, 9.0, -9.0]
    check = learn_check(values)
    assert check.mean == pytest.approx(0.1, abs=0.02)
    assert math.sqrt(check.variance) == pytest.approx(0.05, rel=0.2)
    assert math.sqrt(learn_check([0.1] * 50).variance) == pytest.approx(CHECK_FLOOR, rel=0.02)
    for few in ([], [0.1] * 3, [NAN] * 50):
        assert math.isnan(learn_check(few).mean)


def test_the_power_is_taken_to_nominal_speed(run_of, segments_of):
    datasheet, slow = (
        run_of(segments_of(np.zeros((4, 2)), speed_ratio=speed), power_kw=15.0 * speed**2) for speed in (1.0, 0.8)
    )
    assert log_power(datasheet) == pytest.approx(math.log(15.0))
    assert log_power(slow) == pytest.approx(math.log(15.0))
    assert math.isnan(log_power(run_of(segments_of(np.zeros((4, 2))))))
    mostly = np.where(np.arange(100) < 40, 15.0, NAN)
    assert math.isnan(log_power(run_of(segments_of(np.zeros((4, 2))), power_kw=mostly)))
