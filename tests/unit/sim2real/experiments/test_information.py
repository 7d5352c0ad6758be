"""What an act is expected to tell."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.sim2real.experiments.information import information_bits, resolved_probability, told


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


@given(st.integers(2, 5), st.floats(0.0, 20.0))
def test_more_of_the_same_makes_it_likelier_that_nothing_is_left_open(count, strength):
    probability = np.full(count, 1.0 / count)
    weaker, stronger = (
        resolved_probability(probability, told(probability, -scale * (1.0 - np.eye(probability.size))))
        for scale in (strength, strength + 1.0)
    )
    assert 0.0 <= weaker <= stronger + 1e-6 <= 1.0 + 1e-6


def test_odds_that_just_suffice_on_average_do_so_every_second_time():
    just = np.array([[0.95, 0.05], [0.05, 0.95]])
    assert resolved_probability(np.array([0.5, 0.5]), just) == pytest.approx(0.5)


def test_odds_scatter_as_gaussian_data_make_them():
    """Two sets whose means are so many standard deviations apart: what is drawn resolves as often as is said."""
    apart = 2.5
    drawn = np.random.default_rng(1).normal(size=200_000)
    odds = 0.5 * apart**2 + apart * drawn
    mean = 0.5 * apart**2 * (1.0 - np.eye(2))
    resolved = resolved_probability(np.array([0.5, 0.5]), told(np.array([0.5, 0.5]), -mean))
    assert resolved == pytest.approx(float(np.mean(odds >= np.log(19.0))), abs=0.005)
