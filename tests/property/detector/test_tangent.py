"""What tangent residuals must do for any pump, any rising main and any size of step."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.detector.curves.residuals import level_residuals
from wetwell.detector.statistics.tangent import attribution_index, segment_means, tangent_residuals

c0s = st.floats(15.0, 60.0)
c1s = st.floats(-0.05, 0.0)
c2s = st.floats(-5e-4, -1e-5)
frictions = st.floats(1e-5, 2e-3)
statics = st.floats(0.0, 8.0)
speeds = st.lists(st.floats(0.9, 1.1), min_size=3, max_size=8)
numbers = st.floats(-100.0, 100.0).map(lambda value: value if abs(value) > 1e-100 else 0.0)
NEGLIGIBLE_M = 1e-10


def duty_flow(curve, static_head_m, friction_h2_m5, speed):
    c0, c1, c2 = curve
    a, b, c = c2 - friction_h2_m5, c1 * speed, c0 * speed**2 - static_head_m
    return (-b - np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)


@given(c0=c0s, c1=c1s, c2=c2s, friction=frictions, static=statics, speed=speeds, loss=st.floats(0.01, 0.1))
def test_a_pump_that_drifts_moves_along_the_system_curve(*, c0, c1, c2, friction, static, speed, loss):
    n = np.array(speed)
    worn = n * (1.0 - loss * np.arange(n.size) / n.size)
    flow = duty_flow((c0, c1, c2), static, friction, worn)
    head = static + friction * flow**2
    psi_p, psi_s = tangent_residuals(flow, head, n, curve=(c0, c1, c2), friction_h2_m5=friction)
    assert np.abs(psi_s).max() < NEGLIGIBLE_M
    assert psi_p[0] < -1e-4
    assert attribution_index(psi_p, psi_s) == pytest.approx(1.0, abs=1e-5)


@given(c0=c0s, c1=c1s, c2=c2s, friction=frictions, static=statics, speed=speeds, rise=st.floats(0.1, 1.0))
def test_a_main_that_clogs_moves_the_duty_along_the_pump_curve(*, c0, c1, c2, friction, static, speed, rise):
    n = np.array(speed)
    clogged = friction * (1.0 + rise * np.arange(n.size))
    flow = duty_flow((c0, c1, c2), static, clogged, n)
    head = static + clogged * flow**2
    psi_p, psi_s = tangent_residuals(flow, head, n, curve=(c0, c1, c2), friction_h2_m5=friction)
    assert np.abs(psi_p).max() < NEGLIGIBLE_M
    assert psi_s[0] > 1e-4
    assert attribution_index(psi_p, psi_s) == pytest.approx(0.0, abs=1e-5)


@given(c0=c0s, c1=c1s, c2=c2s, friction=frictions, static=statics, speed=speeds)
def test_a_healthy_change_of_speed_moves_neither(*, c0, c1, c2, friction, static, speed):
    n = np.array(speed)
    flow = duty_flow((c0, c1, c2), static, friction, n)
    head = static + friction * flow**2
    curve = (c0, c1, c2)
    psi_p, psi_s = tangent_residuals(flow, head, n, curve=curve, friction_h2_m5=friction)
    r_p, r_s = level_residuals(flow, head, n, curve=curve, static_head_m=static, friction_h2_m5=friction)
    for residual in (psi_p, psi_s, r_p, r_s):
        assert np.abs(residual).max() < NEGLIGIBLE_M


@given(
    duties=st.lists(st.tuples(st.floats(1.0, 400.0), st.floats(0.0, 60.0), st.floats(0.5, 1.2)), min_size=2),
    c1=c1s,
    c2=c2s,
    friction=frictions,
)
def test_level_residuals_are_the_sums_of_tangent_residuals(duties, c1, c2, friction):
    flow, head, n = np.array(duties).T
    total = 1.5 * flow
    curve = (30.0, c1, c2)
    psi_p, psi_s = tangent_residuals(flow, head, n, curve=curve, friction_h2_m5=friction, total_flow_m3h=total)
    r_p, r_s = level_residuals(
        flow, head, n, curve=curve, static_head_m=3.0, friction_h2_m5=friction, total_flow_m3h=total
    )
    assert np.allclose(r_p, r_p[0] + np.append(0.0, np.cumsum(psi_p)), rtol=0.0, atol=1e-7)
    assert np.allclose(r_s, r_s[0] + np.append(0.0, np.cumsum(psi_s)), rtol=0.0, atol=1e-7)


@given(psi=st.lists(st.tuples(numbers, numbers), min_size=1), scale=st.floats(1e-3, 1e3))
def test_the_index_lies_in_0_to_1_and_knows_neither_scale_nor_sign(psi, scale):
    psi_p, psi_s = np.array(psi).T
    index = attribution_index(psi_p, psi_s)
    assert 0.0 <= index <= 1.0
    assert attribution_index(-scale * psi_p, scale * psi_s) == pytest.approx(index, rel=1e-9, abs=1e-9)
    assert attribution_index(psi_s, psi_p) == pytest.approx(1.0 - index, abs=1e-12)


@given(values=st.lists(numbers, max_size=60), length=st.integers(1, 30))
def test_segment_means_are_the_means_of_the_pieces(values, length):
    means = segment_means(values, length)
    assert means.shape == (len(values) // length,)
    for n, mean in enumerate(means):
        assert mean == pytest.approx(sum(values[n * length : (n + 1) * length]) / length, abs=1e-9)


def test_segments_quiet_the_noise_of_steps():
    rng = np.random.default_rng(0)
    flow, head = 200.0 + 2.0 * rng.normal(size=5000), 26.0 + 0.26 * rng.normal(size=5000)
    single, grouped = (
        tangent_residuals(
            flow,
            head,
            np.ones(5000),
            curve=(36.0, -0.02333, -1.3333e-4),
            friction_h2_m5=6e-4,
            samples_per_segment=size,
        )
        for size in (1, 25)
    )
    assert grouped[0].shape == (199,)
    for noisy, quiet in zip(single, grouped, strict=True):
        assert quiet.std() == pytest.approx(noisy.std() / 5.0, rel=0.2)


def test_degenerate_inputs_have_documented_answers():
    assert attribution_index([], []) == 0.5
    curve = (36.0, 0.0, -1e-4)
    psi_p, psi_s = tangent_residuals([200.0], [26.0], [1.0], curve=curve, friction_h2_m5=6e-4)
    assert psi_p.size == psi_s.size == 0
    r_p, _ = level_residuals(
        [math.nan, 0.0], [26.0, 36.0], [1.0, 1.0], curve=curve, static_head_m=2.0, friction_h2_m5=0.0
    )
    assert np.isnan(r_p[0])
    assert r_p[1] == 0.0
    assert np.isnan(segment_means([1.0, math.nan, 3.0, 5.0], 2)).tolist() == [True, False]


def test_wrong_inputs_are_refused():
    curve = (36.0, 0.0, -1e-4)
    with pytest.raises(ValueError, match="speed_ratio must be positive, got 0"):
        tangent_residuals([200.0] * 2, [26.0] * 2, [1.0, 0.0], curve=curve, friction_h2_m5=6e-4)
    with pytest.raises(ValueError, match="speed_ratio must be positive, got -1"):
        level_residuals([200.0], [26.0], [-1.0], curve=curve, static_head_m=2.0, friction_h2_m5=6e-4)
    with pytest.raises(ValueError, match="one shape"):
        attribution_index([1.0, 2.0], [1.0])
    with pytest.raises(ValueError, match="finite"):
        attribution_index([math.nan], [1.0])
    for values, length in (([1.0, 2.0], 0), ([[1.0], [2.0]], 1)):
        with pytest.raises(ValueError, match="samples_per_segment 1 or more"):
            segment_means(values, length)
