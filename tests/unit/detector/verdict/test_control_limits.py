"""Adaptive limits: learnt from healthy runs, never inside the paper's fixed ones, and what they say."""

import numpy as np
import pytest

from wetwell.detector.baseline.model import learn
from wetwell.detector.verdict.control_limits import RUNS, ControlLimits


@pytest.fixture(scope="module")
def baseline(segments_of):
    rng = np.random.default_rng(0)
    runs = [segments_of(np.array([1.0, -1.0]) + rng.normal(0.0, [0.1, 0.3], (10, 2))) for _ in range(30)]
    return learn(runs, (36.0, -0.02333, -1.3333e-4), 6.0e-4)


def test_limits_are_the_papers_until_healthy_runs_say_more(baseline, segments_of):
    limits = ControlLimits()
    assert limits.limits() == (0.4, 0.6)
    rng = np.random.default_rng(1)
    for _ in range(RUNS):
        limits.add(segments_of(baseline.offset_m + rng.normal(0.0, [0.1, 0.3], (10, 2))), baseline)
    low, high = limits.limits()
    assert 0.1 < low < 0.3, "noise that is three times as large on the system curve gives an index near 1/4"
    assert high == 0.6


def test_limits_follow_the_last_normal_runs_only(baseline, segments_of):
    limits = ControlLimits()
    for size in (0.1, 10.0):
        for _ in range(RUNS):
            limits.add(segments_of(baseline.offset_m + np.array([[size, 1.0]] * 4)), baseline)
    assert limits.limits() == (0.4, pytest.approx(10.0 / 11.0, abs=0.02))


@pytest.mark.parametrize(("shift", "said"), [((3.0, 0.0), "pump"), ((0.0, 3.0), "system"), ((1.0, 1.0), None)])
def test_the_index_tells_a_pump_from_the_system(baseline, segments_of, shift, said):
    rng = np.random.default_rng(2)
    segments = baseline.offset_m + shift + rng.normal(0.0, 0.05, (10, 2))
    figures = ControlLimits().figures(segments_of(segments), baseline, rng)
    assert figures["says"] == said
    assert figures["interval"][0] <= figures["value"] <= figures["interval"][1]
