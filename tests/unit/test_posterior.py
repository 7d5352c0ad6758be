"""Probabilities of the states: against SciPy, and in the cases that anybody would decide alike."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from wetwell.detector.baseline import Baseline
from wetwell.detector.posterior import PRIOR, STATES, Shift, posterior, prior_of_next_run, shift_of
from wetwell.detector.runs import Run

SCALES_M = np.array([5.4, 8.2])
CURVE = (36.0, -0.02333, -1.3333e-4)
FRICTION_H2_M5 = 6.0e-4


def shift(mean_m, *, deviation_m=(0.08, 0.09), correlation=0.0, slope_m=(0.0, 0.0)):
    a, b = deviation_m
    covariance = np.array([[a * a, correlation * a * b], [correlation * a * b, b * b]])
    return Shift(mean_m=np.array(mean_m), covariance=covariance, slope_variance=np.array(slope_m) ** 2)


def by_scipy(shift, scales_m, prior):
    weights = []
    for state in STATES:
        moved = np.zeros((2, 2))
        if "pump" in state:
            moved += np.diag([scales_m[0] ** 2, shift.slope_variance[1]])
        if "system" in state:
            moved += np.diag([shift.slope_variance[0], scales_m[1] ** 2])
        weights.append(
            math.log(prior[len(weights)]) + multivariate_normal.logpdf(shift.mean_m, cov=shift.covariance + moved)
        )
    weights = np.exp(np.array(weights) - max(weights))
    return weights / weights.sum()


metres = st.floats(-3.0, 3.0)
deviations = st.floats(0.02, 2.0)


@given(
    st.builds(
        lambda mean, deviation, correlation, slope: shift(
            mean, deviation_m=deviation, correlation=correlation, slope_m=slope
        ),
        st.tuples(metres, metres),
        st.tuples(deviations, deviations),
        st.floats(-0.9, 0.9),
        st.tuples(metres, metres),
    ),
    st.lists(st.floats(0.001, 1.0), min_size=4, max_size=4),
)
def test_probabilities_sum_to_one_and_are_those_of_scipy(moved, weights):
    prior = np.array(weights) / sum(weights)
    probability = posterior(moved, SCALES_M, prior)
    assert probability.sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(probability, by_scipy(moved, SCALES_M, prior), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("mean_m", "state"),
    [
        ((0.05, -0.05), "normal"),
        ((-1.5, 0.0), "pump_fault"),
        ((0.0, 1.5), "system_fault"),
        ((-1.5, 1.5), "pump_and_system_fault"),
    ],
)
def test_the_curve_that_moved_is_the_one_at_fault(mean_m, state):
    probability = posterior(shift(mean_m), SCALES_M, PRIOR)
    assert probability[STATES.index(state)] > 0.95


def test_a_shift_of_any_size_keeps_finite_probabilities():
    for mean_m in ((1e6, 0.0), (0.0, -1e6), (1e6, 1e6)):
        probability = posterior(shift(mean_m), SCALES_M, PRIOR)
        assert np.isfinite(probability).all()
        assert probability[0] == 0.0


def test_more_noise_is_less_sure():
    sure = [posterior(shift((-0.6, 0.0), deviation_m=(d, d)), SCALES_M, PRIOR)[1] for d in (0.05, 0.1, 0.2, 0.4)]
    assert sorted(sure, reverse=True) == sure
    assert sure[0] > 0.95
    assert sure[-1] < 0.1


def test_slopes_that_may_be_wrong_explain_a_small_shift_of_the_other_curve():
    known, doubtful = shift((0.5, 5.0)), shift((0.5, 5.0), slope_m=(0.5, 0.0))
    assert posterior(known, SCALES_M, PRIOR)[3] > 0.9
    assert posterior(doubtful, SCALES_M, PRIOR)[2] > 0.9


def test_the_next_prior_remembers_but_is_never_certain():
    prior = prior_of_next_run(np.array([0.0, 1.0, 0.0, 0.0]))
    assert prior.sum() == pytest.approx(1.0)
    assert prior[1] > 0.9
    assert (prior > 0.0).all()


BASELINE = Baseline(
    offset_m=np.array([0.2, -0.1]),
    segment_covariance=np.diag([0.06**2, 0.1**2]),
    correlation_factor=1.0,
    run_variance=np.full(2, 0.072**2),
    flow_m3h=200.0,
    total_m3h=200.0,
)


def run_at(flow_m3h, segments, total_m3h=None):
    flow = np.full(len(segments) * 25, flow_m3h)
    return Run(
        pump=0,
        window_ns=(0, 1),
        time_s=np.arange(float(flow.size)),
        flow_m3h=flow,
        head_m=flow,
        speed_ratio=np.ones(flow.size),
        total_flow_m3h=flow if total_m3h is None else np.full(flow.size, total_m3h),
        segments=np.array(segments),
        missing=frozenset(),
    )


def test_the_shift_is_counted_from_the_baseline_and_the_longer_part_of_a_run_tells_it():
    found = shift_of(run_at(200.0, [[0.3, 0.0]] * 6 + [[-9.0, 5.0]] * 4), BASELINE, CURVE, FRICTION_H2_M5)
    np.testing.assert_allclose(found.mean_m, [0.1, 0.1])
    np.testing.assert_allclose(found.slope_variance, 0.0, atol=1e-12)


def test_more_segments_narrow_the_shift_down_to_its_floor():
    few, many = (shift_of(run_at(200.0, [[0.0, 0.0]] * n), BASELINE, CURVE, FRICTION_H2_M5) for n in (4, 400))
    assert (np.diag(many.covariance) < np.diag(few.covariance)).all()
    np.testing.assert_allclose(np.diag(many.covariance), 0.072**2, rtol=0.05)


def test_a_large_shift_of_the_system_stands_out_by_more_sigmas_than_a_small_one():
    sigmas = [
        shift_of(run_at(flow_m3h, [[0.2, system_m]] * 10), BASELINE, CURVE, FRICTION_H2_M5).sigmas[1]
        for flow_m3h, system_m in ((196.0, 1.0), (180.0, 5.0), (150.0, 14.0))
    ]
    assert sigmas[0] > 5.0
    assert sigmas[1] > 3.0 * sigmas[0]
    assert sigmas[2] > 2.0 * sigmas[1]


def test_a_second_pump_on_the_header_moves_the_flow_of_a_healthy_one():
    alone = shift_of(run_at(115.0, [[0.2, -0.1]] * 10), BASELINE, CURVE, FRICTION_H2_M5)
    beside = shift_of(run_at(115.0, [[0.2, -0.1]] * 10, total_m3h=230.0), BASELINE, CURVE, FRICTION_H2_M5)
    assert np.sqrt(alone.covariance[0, 0]) < 0.1
    assert np.sqrt(beside.covariance[0, 0]) > 0.5
    np.testing.assert_allclose(beside.slope_variance, 0.0, atol=1e-12)
