"""Adaptive limits: learnt from healthy runs, never inside the paper's fixed ones, and what they say."""

import numpy as np
import pytest

from wetwell.detector.baseline import Baseline
from wetwell.detector.index_limits import RUNS, IndexLimits
from wetwell.detector.runs import Run


def run_with(segments: np.ndarray) -> Run:
    nothing = np.empty(0)
    return Run(
        pump=0,
        window_ns=(0, 1),
        time_s=nothing,
        flow_m3h=nothing,
        head_m=nothing,
        speed_ratio=nothing,
        total_flow_m3h=nothing,
        segments=segments,
        missing=frozenset(),
    )


@pytest.fixture
def baseline() -> Baseline:
    return Baseline(
        offset_m=np.array([1.0, -1.0]),
        segment_covariance=np.eye(2) * 0.01,
        correlation_factor=1.0,
        run_variance=np.ones(2) * 0.01,
        flow_m3h=200.0,
        total_m3h=200.0,
    )


def test_limits_are_the_papers_until_healthy_runs_say_more(baseline: Baseline) -> None:
    limits = IndexLimits()
    assert limits.limits() == (0.4, 0.6)
    rng = np.random.default_rng(1)
    for _ in range(RUNS):
        limits.add(run_with(baseline.offset_m + rng.normal(0.0, [0.1, 0.3], (10, 2))), baseline)
    low, high = limits.limits()
    assert 0.1 < low < 0.3, "noise that is three times as large on the system curve gives an index near 1/4"
    assert high == 0.6


def test_limits_follow_the_last_normal_runs_only(baseline: Baseline) -> None:
    limits = IndexLimits()
    for size in (0.1, 10.0):
        for _ in range(RUNS):
            limits.add(run_with(baseline.offset_m + np.array([[size, 1.0]] * 4)), baseline)
    assert limits.limits() == (0.4, pytest.approx(10.0 / 11.0))


@pytest.mark.parametrize(("shift", "said"), [((3.0, 0.0), "pump"), ((0.0, 3.0), "system"), ((1.0, 1.0), None)])
def test_the_index_tells_a_pump_from_the_system(
    baseline: Baseline, shift: tuple[float, float], said: str | None
) -> None:
    rng = np.random.default_rng(2)
    segments = baseline.offset_m + shift + rng.normal(0.0, 0.05, (10, 2))
    figures = IndexLimits().figures(run_with(segments), baseline, rng)
    assert figures["says"] == said
    assert figures["interval"][0] <= figures["value"] <= figures["interval"][1]
