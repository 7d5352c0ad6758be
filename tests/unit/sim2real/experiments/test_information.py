"""What an act is expected to tell."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.sim2real.experiments.information import information_bits, told


@st.composite
def truths(draw):
    """Probabilities of some sets, and logarithms of what an act shows under each truth."""
    count = draw(st.integers(2, 5))
    numbers = st.lists(st.floats(0.01, 1.0), min_size=count, max_size=count)
    logs = st.lists(st.lists(st.floats(-50.0, 50.0), min_size=count, max_size=count), min_size=count, max_size=count)
    weights = np.array(draw(numbers))
    return weights / weights.sum(), np.array(draw(logs))


@given(truths())
def test_a_posterior_sums_to_one_and_nothing_tells_more_than_there_is_to_know(drawn):
    probability, logs = drawn
    after = told(probability, logs)
    assert after.sum(axis=1) == pytest.approx(np.ones(probability.size))
    entropy_bits = -float(np.sum(probability * np.log2(probability)))
    assert information_bits(probability, after) <= entropy_bits + 1e-9


@given(truths())
def test_what_all_sets_share_tells_nothing(drawn):
    probability, logs = drawn
    same = np.repeat(logs[:, :1], probability.size, axis=1)
    assert told(probability, same) == pytest.approx(np.tile(probability, (probability.size, 1)))
    assert information_bits(probability, told(probability, same)) == pytest.approx(0.0, abs=1e-9)


def test_an_act_that_makes_sure_of_a_wrong_set_tells_nothing():
    probability = np.array([0.8, 0.1, 0.1])
    misled = told(probability, np.array([[0.0, 20.0, 0.0]] * 3))
    assert information_bits(probability, misled) < -5.0 < information_bits(probability, np.eye(3))


def test_the_likelihood_counts_by_its_power():
    after = told(np.array([0.5, 0.5]), np.array([[0.0, -10.0], [-10.0, 0.0]]))
    assert after[0, 0] / after[0, 1] == pytest.approx(np.exp(10.0))
