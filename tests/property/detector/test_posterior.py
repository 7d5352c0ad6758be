"""Probabilities of the hypotheses against a second formulation: each way to shift drawn by hand, judged by SciPy."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal, norm

from wetwell.detector.inference.observation import Observation
from wetwell.detector.inference.posterior import Scales, posterior_of

SIZES = (1.0, 10.0, 0.02)
NAN = math.nan
FAULTS_OF_CURVES = {0: "", 1: "p", 2: "s", 3: "ps"}


def ways(hypothesis, observation, scales):
    """(probability, loadings) of each way: independent standard normal numbers times the columns of the loadings."""
    slope_p, slope_s = np.sqrt(observation.slope_variance)
    unit = np.eye(4)
    is_meter = hypothesis >= 4
    moving = 0.05 if is_meter else 0.5
    for size, is_disturbed, is_moving in itertools.product(SIZES, (False, True), (False, True)):
        columns = []
        root = math.sqrt(size)
        if "p" in FAULTS_OF_CURVES.get(hypothesis, ""):
            columns += [root * scales.pump_m * unit[0], slope_s * unit[1]]
        if "s" in FAULTS_OF_CURVES.get(hypothesis, ""):
            columns += [root * scales.system_m * unit[1], slope_p * unit[0]]
        if hypothesis == 4:
            columns.append(root * 0.1 * observation.flow_meter)
        if hypothesis == 5:
            columns.append(root * scales.head_m * observation.head_sensor)
        columns += [0.5 * is_disturbed * unit[2], 0.15 * is_moving * unit[3]]
        share = (0.05 if is_disturbed else 0.95) * (moving if is_moving else 1.0 - moving) / len(SIZES)
        yield share, np.column_stack(columns)


def by_scipy(observation, scales, prior):
    known = [
        i for i in range(4) if math.isfinite(observation.mean[i]) and math.isfinite(observation.covariance[i, i])
    ]
    pick = np.ix_(known, known)
    logs = []
    for hypothesis in range(6):
        each = [
            math.log(share)
            + multivariate_normal.logpdf(
                observation.mean[known], cov=observation.covariance[pick] + (loadings @ loadings.T)[pick]
            )
            for share, loadings in ways(hypothesis, observation, scales)
        ]
        logs.append(math.log(prior[hypothesis]) + np.logaddexp.reduce(each))
    shift_m, deviation_m = regression(observation, scales, known)
    losing, rising = norm.cdf(-shift_m[0] / deviation_m[0]), norm.cdf(shift_m[1] / deviation_m[1])
    pump_sign, system_sign = 0.1 + 1.8 * losing, 0.2 + 1.6 * rising
    signs = np.log([1.0, pump_sign, system_sign, pump_sign * system_sign, 1.0, 1.0])
    weights = np.exp(np.array(logs) + signs - max(np.array(logs) + signs))
    return weights / weights.sum(), shift_m, deviation_m


def regression(observation, scales, known):
    """Mean and deviation of both shifts by the normal equations of a ridge regression."""
    noise = observation.covariance + np.diag([*observation.slope_variance, 0.0, 0.0])
    design, precision = np.eye(4)[known][:, :2], np.linalg.inv(noise[np.ix_(known, known)])
    covariance = np.linalg.inv(
        design.T @ precision @ design + np.diag([1.0 / scales.pump_m**2, 1.0 / scales.system_m**2])
    )
    return covariance @ design.T @ precision @ observation.mean[known], np.sqrt(np.diag(covariance))


metres = st.floats(-3.0, 3.0)
deviations = st.floats(0.05, 2.0)
logs = st.floats(-0.5, 0.5) | st.just(NAN)


@st.composite
def observations(draw):
    a, b = draw(deviations), draw(deviations)
    c, d = draw(st.floats(0.01, 0.1)), draw(st.floats(0.01, 0.1) | st.just(NAN))
    covariance = np.diag([a * a, b * b, c * c, d * d])
    covariance[0, 1] = covariance[1, 0] = draw(st.floats(-0.9, 0.9)) * a * b
    return Observation(
        mean=np.array([draw(metres), draw(metres), draw(logs), draw(logs)]),
        covariance=covariance,
        slope_variance=np.array([draw(st.floats(0.0, 2.0)), draw(st.floats(0.0, 2.0))]) ** 2,
        flow_meter=np.array([draw(st.floats(1.0, 30.0)), draw(st.floats(-60.0, -1.0)), 1.0, 0.0]),
        head_sensor=np.array([draw(st.floats(0.8, 4.0)), 1.0, 0.0, 0.0]),
    )


scales = st.builds(
    lambda pump_m, system_m, head_m: Scales(pump_m=pump_m, system_m=system_m, head_m=head_m),
    st.floats(1.0, 10.0),
    st.floats(1.0, 10.0),
    st.floats(0.5, 8.0),
)


@given(observations(), scales, st.lists(st.floats(0.001, 1.0), min_size=6, max_size=6))
def test_probabilities_sum_to_one_and_are_those_of_scipy(observation, scales, weights):
    prior = np.array(weights) / sum(weights)
    weighed = posterior_of(observation, scales, prior)
    assert weighed.probability.sum() == pytest.approx(1.0, abs=1e-12)
    probability, shift_m, deviation_m = by_scipy(observation, scales, prior)
    np.testing.assert_allclose(weighed.probability, probability, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(weighed.shift_m, shift_m, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(weighed.deviation_m, deviation_m, rtol=1e-6)
