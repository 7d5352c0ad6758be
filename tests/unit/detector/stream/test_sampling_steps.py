"""The usual step of a feed."""

import numpy as np
import pytest

from wetwell.detector.stream.sampling_steps import SLOWEST_STEP_S, USUAL, new_sampling_steps, note_step


def usual_s(*heard_s):
    steps = new_sampling_steps()
    for step_s in heard_s:
        note_step(steps, step_s)
    return steps[USUAL]


def test_nothing_is_known_before_the_second_sample():
    assert usual_s() == 0.0


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9])
def test_it_is_the_lower_median_of_the_last_five(count):
    heard_s = np.random.default_rng(count).permutation(np.arange(1.0, count + 1.0))
    last = np.sort(heard_s[-5:])
    assert usual_s(*heard_s) == last[(len(last) - 1) // 2]


@pytest.mark.parametrize("odd_s", [0.0, -5.0, np.inf, np.nan, SLOWEST_STEP_S + 1.0])
def test_a_step_that_is_none_does_not_count(odd_s):
    assert usual_s(odd_s) == 0.0
    assert usual_s(900.0, *[odd_s] * 9) == 900.0


def test_two_of_five_bend_nothing():
    assert usual_s(900.0, 1.0, 900.0, 1500.0, 900.0) == 900.0
