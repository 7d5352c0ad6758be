"""Whether groups have changed: false alarms at the promised share, changes found, the moment of a step."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wetwell.sim2real.watch.change import FALSE_CHANGES, changed_groups, step_ns
from wetwell.sim2real.watch.look import Shift


def shift_of(values):
    return Shift(
        mean=float(values.mean()), error=float(values.std(ddof=1) / np.sqrt(values.size)), cycles=values.size
    )


def test_noise_alone_is_taken_for_a_change_about_as_seldom_as_promised():
    """With the least change at 0, 20,000 looks of ten groups with five cycles each: Student's tails, not Gauss'."""
    rng = np.random.default_rng(11)
    looks, false = 20_000, 0
    for _ in range(looks):
        values = rng.normal(size=(2, 10, 5))
        means, errors = values.mean(axis=-1).tolist(), (values.std(axis=-1, ddof=1) / np.sqrt(5)).tolist()
        now, before = (
            {str(k): Shift(mean=means[part][k], error=errors[part][k], cycles=5) for k in range(10)}
            for part in range(2)
        )
        false += bool(changed_groups(now, before, least=0.0))
    assert false <= 4 * FALSE_CHANGES * looks


@given(
    distance=st.floats(1.0, 20.0),
    side=st.sampled_from([-1.0, 1.0]),
    noise=st.floats(0.001, 0.1),
    seed=st.integers(0, 1000),
)
def test_what_matters_is_found_and_has_its_size_and_sign(distance, side, noise, seed):
    rng = np.random.default_rng(seed)
    before = {name: shift_of(rng.normal(0.0, noise, 40)) for name in "abc"}
    now = {**before, "b": shift_of(rng.normal(side * distance, noise, 40))}
    changed = changed_groups(now, before)
    assert list(changed) == ["b"]
    assert abs(changed["b"] - side * distance) < 10.0 * noise


def test_a_group_that_was_not_there_is_held_against_the_simulator():
    rng = np.random.default_rng(3)
    assert list(changed_groups({"new": shift_of(rng.normal(2.0, 0.1, 30))}, {})) == ["new"]
    assert changed_groups({"new": shift_of(rng.normal(0.0, 0.1, 30))}, {}) == {}


def test_the_largest_difference_comes_first():
    before = {name: Shift(mean=0.0, error=0.01, cycles=50) for name in "ab"}
    now = {"a": Shift(mean=1.0, error=0.01, cycles=50), "b": Shift(mean=-3.0, error=0.01, cycles=50)}
    assert list(changed_groups(now, before)) == ["b", "a"]


@given(place=st.integers(0, 59), size=st.floats(3.0, 30.0), seed=st.integers(0, 100))
def test_a_step_is_found_within_two_cycles(place, size, seed):
    values = np.random.default_rng(seed).normal(0.0, 0.3, 60)
    values[place:] += size
    assert abs(step_ns(np.arange(60), values, 0.0) - place) <= 2
