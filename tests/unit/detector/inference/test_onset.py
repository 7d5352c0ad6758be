"""The corner of the broken line, against faults of which the beginning is known."""

import numpy as np
import pytest

from wetwell.detector.inference.onset import onset_s

TIMES_S = np.arange(12) * 1800.0


@pytest.mark.parametrize("corner_s", [3_000.0, 7_200.0, 12_500.0])
def test_the_corner_of_a_ramp_is_found(corner_s):
    shift_m = -2e-4 * np.maximum(TIMES_S - corner_s, 0.0)
    assert onset_s(TIMES_S, shift_m) == pytest.approx(corner_s, abs=400.0)


def test_it_is_found_in_noise_and_without_bias():
    rng, corner_s = np.random.default_rng(0), 9_000.0
    found = [
        onset_s(TIMES_S, 3e-4 * np.maximum(TIMES_S - corner_s, 0.0) + 0.1 * rng.normal(size=12)) for _ in range(200)
    ]
    assert np.mean(found) == pytest.approx(corner_s, abs=300.0)
    assert np.std(found) < 900.0


def test_a_step_lies_between_the_last_healthy_run_and_the_first_at_fault():
    shift_m = np.where(np.arange(12) == 11, -3.0, 0.0)
    assert TIMES_S[10] - 400.0 <= onset_s(TIMES_S, shift_m) <= TIMES_S[11]


def test_one_run_alone_is_its_own_beginning():
    assert onset_s([4_200.0], [-1.0]) == 4_200.0


def test_the_onset_stays_within_the_runs():
    for shift_m in (np.zeros(12), np.ones(12), TIMES_S * 1e-3, -TIMES_S * 1e-3):
        assert TIMES_S[0] <= onset_s(TIMES_S, shift_m) <= TIMES_S[-1]
