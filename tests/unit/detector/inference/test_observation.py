"""What a run shows against its baseline, with the error that it may have."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wetwell.detector.baseline.healthy_reference import Check, HealthyReference
from wetwell.detector.baseline.model import learn
from wetwell.detector.curves.residuals import level_residuals
from wetwell.detector.curves.sensor_signatures import flow_meter_direction, head_sensor_direction
from wetwell.detector.inference.observation import DRAWDOWN, POWER, PUMP, SYSTEM, observe

CURVE = (36.0, -0.02333, -1.3333e-4)
FRICTION_H2_M5 = 6.0e-4
NAN = math.nan
NO_CHECK = Check(mean=NAN, variance=NAN)


@pytest.fixture(scope="module")
def baseline(segments_of):
    """200 m³/h, offset (0.2, -0.1), nothing known of the slopes but the datasheet."""
    rng = np.random.default_rng(0)
    runs = [segments_of([0.2, -0.1] + rng.normal(size=(10, 2)) * [0.06, 0.1]) for _ in range(100)]
    return learn(runs, CURVE, FRICTION_H2_M5)


def seen(run, baseline, drawdown=NO_CHECK, power=NO_CHECK):
    reference = HealthyReference(
        version=1, learnt_ns=0, baseline=baseline, drawdown=drawdown, power=power, noise=np.full(2, NAN)
    )
    return observe(run, reference, CURVE, FRICTION_H2_M5)


def test_the_shift_is_counted_from_the_baseline_and_the_longer_part_of_a_run_tells_it(run_of, segments_of, baseline):
    found = seen(run_of(segments_of([[0.3, 0.0]] * 6 + [[-9.0, 5.0]] * 4)), baseline)
    np.testing.assert_allclose(found.mean[:2], [0.1, 0.1], atol=0.02)
    np.testing.assert_allclose(found.slope_variance, 0.0, atol=1e-4)
    assert np.isnan(found.mean[2:]).all()


def test_more_segments_narrow_the_shift_down_to_its_floor(run_of, segments_of, baseline):
    few, many = (seen(run_of(segments_of([[0.2, -0.1]] * n)), baseline).covariance[:2, :2] for n in (4, 400))
    assert (np.diag(many) < np.diag(few)).all()
    np.testing.assert_allclose(np.diag(many), np.diag(baseline.run_covariance), rtol=0.15)


def test_the_error_bars_cover_healthy_runs(run_of, segments_of, baseline):
    rng = np.random.default_rng(1)
    sigmas = [
        seen(
            run_of(segments_of([0.2, -0.1] + 0.036 * rng.normal(size=2) + rng.normal(size=(10, 2)) * [0.06, 0.1])),
            baseline,
        )
        for _ in range(400)
    ]
    spread = np.std([found.sigmas[:2] for found in sigmas], axis=0)
    assert (spread > 0.7).all(), spread
    assert (spread < 1.15).all(), spread


def test_a_run_that_scatters_more_is_trusted_less(run_of, segments_of, baseline):
    rng = np.random.default_rng(2)
    calm = seen(run_of(segments_of([0.2, -0.1] + rng.normal(size=(40, 2)) * 0.08)), baseline)
    wild = seen(run_of(segments_of([0.2, -0.1] + rng.normal(size=(40, 2)) * 0.8)), baseline)
    assert wild.covariance[PUMP, PUMP] > 3.0 * calm.covariance[PUMP, PUMP]


def test_a_large_shift_of_the_system_stands_out_by_more_sigmas_than_a_small_one(run_of, segments_of, baseline):
    sigmas = [
        seen(run_of(segments_of([[0.2, system_m]] * 10, flow_m3h=flow_m3h, duty_m3h=200.0)), baseline).sigmas[SYSTEM]
        for flow_m3h, system_m in ((196.0, 1.0), (180.0, 5.0), (150.0, 14.0))
    ]
    assert sigmas[0] > 5.0
    assert sigmas[1] > 2.0 * sigmas[0]
    assert sigmas[2] > 1.5 * sigmas[1]


def test_slopes_widen_the_bars_where_health_goes_and_the_faults_where_only_a_fault_goes(
    run_of, segments_of, baseline
):
    alone = seen(run_of(segments_of([[0.2, -0.1]] * 10, flow_m3h=115.0, duty_m3h=200.0)), baseline)
    beside = seen(run_of(segments_of([[0.2, -0.1]] * 10, flow_m3h=115.0, total_m3h=230.0)), baseline)
    assert np.sqrt(alone.covariance[PUMP, PUMP]) < 0.2
    assert np.sqrt(alone.slope_variance[PUMP]) > 0.3
    assert np.sqrt(beside.covariance[PUMP, PUMP]) > 0.3
    np.testing.assert_allclose(beside.slope_variance, 0.0, atol=1e-12)


@pytest.mark.parametrize("speed_ratio", [0.7, 1.0])
def test_the_directions_of_the_meters_are_those_of_the_residuals(speed_ratio):
    """Against a difference quotient of the residuals themselves."""
    flow_m3h, head_m, step = 150.0, 18.0, 1e-6

    def residuals(gain, error_m):
        return np.array(
            level_residuals(
                [flow_m3h * (1.0 + gain)],
                [head_m + error_m],
                [speed_ratio],
                curve=CURVE,
                static_head_m=2.0,
                friction_h2_m5=FRICTION_H2_M5,
                total_flow_m3h=[flow_m3h * (1.0 + gain) + 60.0],
            )
        )[:, 0]

    by_gain, by_error = ((residuals(*way) - residuals(0.0, 0.0)) / step for way in ((step, 0.0), (0.0, step)))
    direction = flow_meter_direction(flow_m3h / speed_ratio, flow_m3h, flow_m3h + 60.0, CURVE, FRICTION_H2_M5)
    np.testing.assert_allclose(direction, by_gain, rtol=1e-4)
    np.testing.assert_allclose(head_sensor_direction(speed_ratio), by_error, rtol=1e-4)


def test_drawdown_and_power_are_counted_from_health(run_of, segments_of, baseline):
    run = replace(run_of(segments_of([[0.2, -0.1]] * 10), power_kw=12.0), log_ratio=0.25)
    found = seen(run, baseline, Check(mean=0.1, variance=0.02**2), Check(mean=math.log(10.0), variance=0.01**2))
    assert found.mean[DRAWDOWN] == pytest.approx(0.15)
    assert found.sigmas[DRAWDOWN] == pytest.approx(7.5)
    assert found.mean[POWER] == pytest.approx(math.log(1.2))
    assert found.flow_meter[DRAWDOWN] == 1.0
    assert found.head_sensor[DRAWDOWN] == found.head_sensor[POWER] == found.flow_meter[POWER] == 0.0
