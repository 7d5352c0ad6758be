"""Which hypothesis explains a run, in the cases that anybody would decide alike."""

import math

import numpy as np
import pytest

from wetwell.detector.curves.sensor_signatures import flow_meter_direction, head_sensor_direction
from wetwell.detector.inference.observation import DRAWDOWN, Observation
from wetwell.detector.inference.posterior import (
    BOTH,
    FLOW_METER,
    HEAD_SENSOR,
    NORMAL,
    PUMP_FAULT,
    SYSTEM_FAULT,
    Scales,
    posterior_of,
)
from wetwell.detector.inference.prior import PumpPrior, SystemPrior, joint_prior

CURVE = (36.0, -0.02333, -1.3333e-4)
FRICTION_H2_M5 = 6.0e-4
SCALES = Scales(pump_m=5.4, system_m=8.2, head_m=3.6)
PRIOR = joint_prior(PumpPrior(), SystemPrior())
FLOW_DIRECTION = flow_meter_direction(200.0, 200.0, 200.0, CURVE, FRICTION_H2_M5)
NAN = math.nan


def seen(shift_m, *, drawdown=NAN, power=NAN, deviation_m=(0.08, 0.09), slope_m=(0.0, 0.0)):
    return Observation(
        mean=np.array([*shift_m, drawdown, power]),
        covariance=np.diag([*np.square(deviation_m), 0.02**2, 0.01**2]),
        slope_variance=np.square(slope_m),
        flow_meter=np.array([*FLOW_DIRECTION, 1.0, 0.0]),
        head_sensor=np.array([*head_sensor_direction(1.0), 0.0, 0.0]),
    )


def probability(*arguments, **keywords):
    return posterior_of(seen(*arguments, **keywords), SCALES, PRIOR).probability


@pytest.mark.parametrize(
    ("shift_m", "hypothesis"),
    [((0.05, -0.05), NORMAL), ((-1.5, 0.0), PUMP_FAULT), ((0.0, 1.5), SYSTEM_FAULT), ((-1.5, 1.5), BOTH)],
)
def test_the_curve_that_moved_is_the_one_at_fault(shift_m, hypothesis):
    assert probability(shift_m)[hypothesis] > 0.95
    assert probability(shift_m, drawdown=0.0, power=0.0)[hypothesis] > 0.95


@pytest.mark.parametrize("error", [-0.15, -0.06, 0.06, 0.15])
def test_a_flow_meter_with_the_drawdown_against_it_is_the_one_that_is_wrong(error):
    weighed = posterior_of(seen(error * FLOW_DIRECTION, drawdown=error, power=0.0), SCALES, PRIOR)
    assert weighed.probability[FLOW_METER] > 0.99
    assert weighed.flow_error == pytest.approx(error, abs=0.01)
    assert abs(weighed.flow_error - error) < 2.5 * weighed.flow_deviation < 0.025


@pytest.mark.parametrize("error_m", [-3.0, -1.0, 1.0, 3.0])
def test_a_head_sensor_with_drawdown_and_power_in_order_is_the_one_that_is_wrong(error_m):
    weighed = posterior_of(seen((error_m, error_m), drawdown=0.0, power=0.0), SCALES, PRIOR)
    assert weighed.probability[HEAD_SENSOR] > 0.9
    assert weighed.head_error_m == pytest.approx(error_m, abs=0.1)
    assert abs(weighed.head_error_m - error_m) < 2.5 * weighed.head_deviation_m < 0.5


def test_the_drawdown_tells_a_fault_of_both_curves_from_a_flow_meter():
    shift_m = -0.1 * FLOW_DIRECTION
    with_meter, with_pump = probability(shift_m, drawdown=-0.1), probability(shift_m, drawdown=0.0)
    assert with_meter[FLOW_METER] / with_meter[BOTH] > 100.0
    assert with_pump[BOTH] / with_pump[FLOW_METER] > 1.0


def test_a_disturbed_drawdown_alone_blames_nobody():
    assert probability((0.0, 0.0), drawdown=0.4)[NORMAL] > 0.9
    assert probability((-1.5, 0.0), drawdown=0.4)[PUMP_FAULT] > 0.95


def test_the_power_alone_is_no_fault():
    assert probability((0.0, 0.0), drawdown=0.0, power=0.3)[NORMAL] > 0.9


def test_a_component_that_is_not_known_is_left_out():
    unknown = seen((-0.3, 0.1))
    assert np.isfinite(posterior_of(unknown, SCALES, PRIOR).probability).all()
    vague = seen((-0.3, 0.1), drawdown=0.0, power=0.0)
    vague.covariance[2, 2] = vague.covariance[3, 3] = 1e12
    np.testing.assert_allclose(
        posterior_of(unknown, SCALES, PRIOR).probability, posterior_of(vague, SCALES, PRIOR).probability, atol=1e-6
    )


@pytest.mark.parametrize("shift_m", [(1e6, 0.0), (0.0, -1e6), (1e6, 1e6)])
def test_a_shift_of_any_size_keeps_finite_probabilities(shift_m):
    found = probability(shift_m)
    assert np.isfinite(found).all()
    assert found[NORMAL] == 0.0


def test_more_noise_is_less_sure():
    sure = [probability((-0.6, 0.0), deviation_m=(d, d))[PUMP_FAULT] for d in (0.05, 0.1, 0.2, 0.4)]
    assert sorted(sure, reverse=True) == sure
    assert sure[0] > 0.95
    assert sure[-1] < 0.3


def test_slopes_that_may_be_wrong_explain_a_small_shift_of_the_other_curve():
    assert probability((-0.5, 5.0))[BOTH] > 0.9
    assert probability((-0.5, 5.0), slope_m=(0.5, 0.0))[SYSTEM_FAULT] > 0.9


def test_a_pump_that_loses_is_believed_sooner_than_one_that_gains():
    assert probability((-0.3, 0.0))[PUMP_FAULT] > 2.0 * probability((0.3, 0.0))[PUMP_FAULT]
    assert probability((0.0, 0.3))[SYSTEM_FAULT] > probability((0.0, -0.3))[SYSTEM_FAULT]


def test_a_flow_meter_is_believed_to_one_percent_unless_the_drawdown_watches_it():
    observation = seen((0.0, 1.5))
    for deviation in (NAN, 0.02):
        observation.covariance[DRAWDOWN, DRAWDOWN] = deviation**2
        np.testing.assert_allclose(
            posterior_of(observation, SCALES, PRIOR).tolerance_m, np.abs(0.01 * FLOW_DIRECTION)
        )
    observation.covariance[DRAWDOWN, DRAWDOWN] = 0.005**2
    assert posterior_of(observation, SCALES, PRIOR).tolerance_m.tolist() == [0.0, 0.0], "learnt, not seen in this run"
