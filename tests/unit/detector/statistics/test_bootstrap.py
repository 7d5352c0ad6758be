"""Block bootstrap of the attribution index: coverage, repeatability, degenerate series."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from wetwell.detector.statistics.bootstrap import block_bootstrap_interval
from wetwell.detector.statistics.tangent import attribution_index


def interval(psi_p, psi_s, seed=0, *, block=5, resamples=400, confidence=0.95):
    return block_bootstrap_interval(
        psi_p, psi_s, block=block, resamples=resamples, confidence=confidence, rng=np.random.default_rng(seed)
    )


def covered(*, block, correlation, trials=400):
    """Share of intervals that hold the true index, here 2 / (2 + 1), of Gaussian AR(1) residuals."""
    rng, hits = np.random.default_rng(42), 0
    for _ in range(trials):
        noise = rng.normal(size=(2, 400)) * math.sqrt(1.0 - correlation**2)
        psi_p, psi_s = lfilter([1.0], [1.0, -correlation], noise)[:, 100:] * np.array([[2.0], [1.0]])
        low, high = block_bootstrap_interval(psi_p, psi_s, block=block, resamples=300, confidence=0.95, rng=rng)
        hits += low <= 2.0 / 3.0 <= high
    return hits / trials


def test_95_percent_intervals_hold_the_true_index_about_as_often():
    assert 0.90 <= covered(block=5, correlation=0.0) <= 0.98


def test_blocks_keep_the_coverage_of_correlated_residuals_that_single_samples_lose():
    blocks, singles = covered(block=20, correlation=0.9), covered(block=1, correlation=0.9)
    assert blocks > 0.82
    assert singles < 0.70


def test_same_seed_same_numbers_and_another_seed_others():
    rng = np.random.default_rng(3)
    psi_p, psi_s = rng.normal(size=(2, 120))
    assert interval(psi_p, psi_s, 1) == interval(psi_p, psi_s, 1)
    assert interval(psi_p, psi_s, 1) != interval(psi_p, psi_s, 2)


@pytest.mark.parametrize("block", [1, 3, 5, 7, 49, 50])
def test_resamples_are_blocks_of_pairs_cut_to_the_length_of_the_series(block):
    rng = np.random.default_rng(block)
    psi_p, psi_s = rng.normal(size=(2, 50))
    draw, indices = np.random.default_rng(9), []
    starts = draw.integers(0, 50 - block + 1, size=(200, math.ceil(50 / block)))
    for row in starts:
        picked = np.concatenate([np.arange(start, start + block) for start in row])[:50]
        indices.append(attribution_index(psi_p[picked], psi_s[picked]))
    expected = np.quantile(indices, [0.05, 0.95])
    found = interval(psi_p, psi_s, 9, block=block, resamples=200, confidence=0.9)
    assert found == pytest.approx(tuple(expected), abs=1e-12)


def test_the_interval_narrows_with_confidence_and_with_length():
    psi_p, psi_s = np.random.default_rng(5).normal(size=(2, 4000))
    wide, narrow = interval(psi_p[:400], psi_s[:400]), interval(psi_p[:400], psi_s[:400], confidence=0.5)
    long = interval(psi_p, psi_s)
    assert wide[0] < narrow[0] < narrow[1] < wide[1]
    assert long[1] - long[0] < 0.5 * (wide[1] - wide[0])


def test_degenerate_series_have_documented_answers():
    zeros, ones = np.zeros(30), np.ones(30)
    assert interval(zeros, zeros) == (0.5, 0.5)
    assert interval(ones, zeros) == (1.0, 1.0)
    assert interval(zeros, ones) == (0.0, 0.0)
    assert interval([3.0], [-1.0], block=1) == (0.75, 0.75)
    psi_p, psi_s = np.random.default_rng(6).normal(size=(2, 30))
    low, high = interval(psi_p, psi_s, block=30)
    assert low == high == pytest.approx(attribution_index(psi_p, psi_s))


@pytest.mark.parametrize(
    ("psi", "settings", "message"),
    [
        (([1.0, math.nan], [1.0, 1.0]), {"block": 1}, "finite"),
        (([], []), {}, r"block must lie in \[1, 0\]"),
        (([1.0] * 4, [1.0] * 4), {"block": 5}, r"block must lie in \[1, 4\], the number of residuals, got 5"),
        (([1.0] * 4, [1.0] * 4), {"block": 0}, "block must lie"),
        (([1.0] * 4, [1.0] * 4), {"block": 2, "resamples": 0}, "resamples must be 1 or more"),
        (([1.0] * 4, [1.0] * 4), {"block": 2, "confidence": 1.0}, "confidence between 0 and 1"),
        (([1.0] * 4, [1.0] * 3), {"block": 2}, "inhomogeneous"),
    ],
)
def test_wrong_inputs_are_refused(psi, settings, message):
    with pytest.raises(ValueError, match=message):
        interval(*psi, **settings)
