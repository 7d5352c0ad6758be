"""The reliability of probabilities that are known to be right, or known to be wrong."""

import numpy as np
import pytest
from scipy.stats import binomtest

from wetwell.detector.evaluation.reliability import binomial_interval, reliability
from wetwell.detector.evaluation.scores import ScoredRun


def runs_of(given, is_fault):
    return [
        ScoredRun(1, "normal", "pump_fault" if fault else "normal", fault_probability=float(p))
        for p, fault in zip(given, is_fault, strict=True)
    ]


def test_probabilities_that_are_true_are_found_to_be_and_wrong_ones_not():
    rng = np.random.default_rng(5)
    given = rng.random(20_000)
    honest = reliability(runs_of(given, rng.random(20_000) < given))
    wrong = reliability(runs_of(given, rng.random(20_000) < given**3))
    assert honest["expected_error"] < 0.02
    assert wrong["expected_error"] > 0.2
    assert honest["brier"] == pytest.approx(1 / 6, abs=0.01)
    assert honest["log_score"] == pytest.approx(0.5, abs=0.01)
    assert sum(row["runs"] for row in honest["bins"]) == 20_000


def test_the_intervals_hold_as_often_as_they_say():
    held = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        given = rng.random(1000)
        bins = reliability(runs_of(given, rng.random(1000) < given))["bins"]
        held += [row["interval_95"][0] <= row["mean_probability"] <= row["interval_95"][1] for row in bins]
    assert 0.93 < np.mean(held) < 1.0


def test_figures_by_hand():
    figures = reliability(runs_of([0.0, 0.2, 0.2, 1.0], [False, False, True, True]))
    assert [(row["from"], row["runs"], row["fault_share"]) for row in figures["bins"]] == [
        (0.0, 1, 0.0),
        (0.1, 2, 0.5),
        (0.99, 1, 1.0),
    ]
    assert figures["expected_error"] == pytest.approx(0.15)
    assert figures["brier"] == pytest.approx((0.04 + 0.64) / 4)
    assert figures["log_score"] == pytest.approx(-(np.log(0.8) + np.log(0.2)) / 4)


def test_certainties_are_no_probabilities():
    assert reliability(runs_of([0.0, 1.0, np.nan], [False, True, True])) is None


@pytest.mark.parametrize(("hits", "count"), [(0, 5), (5, 5), (3, 40)])
def test_the_interval_is_that_of_clopper_and_pearson(hits, count):
    exact = binomtest(hits, count).proportion_ci(method="exact")
    assert binomial_interval(hits, count) == pytest.approx((exact.low, exact.high))
