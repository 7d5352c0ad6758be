"""Whether an effect is there: the recording needs it, and no other does the same."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from wetwell.sim2real.attribution.weighing.presence import SURE, are_needed, could_others, own_signature, unshifted
from wetwell.sim2real.likelihood.evidence import Evidence


def needed(*squares):
    return Evidence(
        log=0.0,
        by_block=np.zeros(0),
        residuals=np.zeros(0),
        step=np.zeros(0),
        gained=0.0,
        precision=np.zeros((0, 0)),
        stirred=(),
        needed=np.array(squares),
    )


@pytest.mark.parametrize("strengths", [1, 2, 3])
def test_an_effect_is_there_where_the_recording_is_surely_likelier_with_it(strengths):
    quantile = stats.chi2.ppf(SURE, strengths)
    assert are_needed(needed(1.001 * quantile, 0.999 * quantile), [strengths, strengths]).tolist() == [True, False]


def test_without_effects_nothing_is_needed():
    assert are_needed(needed(), []).size == 0


def test_of_two_effects_that_undo_each_other_neither_has_anything_of_its_own():
    rng = np.random.default_rng(6)
    form, allowed = rng.normal(size=50), rng.uniform(0.5, 2.0, 50)
    small = 0.01 * rng.normal(size=50)
    middle = np.array([-0.5]), np.array([0.5])
    left = own_signature(40.0 * form + small, -100.0 * form[:, None], allowed, middle)
    assert np.linalg.norm(left) <= 1.01 * np.linalg.norm(small) * allowed.max() / allowed.min()
    apart = rng.normal(size=50)
    assert np.linalg.norm(own_signature(apart, -100.0 * form[:, None], allowed, middle)) > 0.8 * np.linalg.norm(apart)
    assert np.array_equal(own_signature(apart, np.zeros((50, 0)), allowed, (np.zeros(0), np.zeros(0))), apart)


def test_no_effect_does_anothers_work_beyond_its_range():
    form, allowed = np.random.default_rng(6).normal(size=50), np.ones(50)
    at_its_end = np.zeros(1), np.ones(1)
    assert own_signature(0.4 * form, form[:, None], allowed, at_its_end) == pytest.approx(0.4 * form)
    assert own_signature(0.4 * form, -form[:, None], allowed, at_its_end) == pytest.approx(np.zeros(50))
    assert own_signature(1.4 * form, -form[:, None], allowed, at_its_end) == pytest.approx(0.4 * form)


@pytest.mark.parametrize(("power", "could"), [(1.0, True), (1.3, True), (4.0, False)])
def test_the_simulator_says_whether_others_could_do_an_effects_work(power, could):
    """A lag goes like a delay by its slope, but not all of the way; what bends a little is gone on with."""
    form, allowed, seen = np.random.default_rng(7).normal(size=50), np.ones(50), []

    def left_of(position):
        seen.append(float(position[0]))
        return (8.0 - 10.0 * position[0] ** power) * form + 20.0 * (power > 2.0) * position[0] * np.abs(form)

    def is_within(left):
        return float(np.mean(left**2)) <= 1.0

    slope = -10.0 * form[:, None]
    assert could_others(8.0 * form, slope, np.zeros(1), allowed, is_within, left_of) == could
    assert all(0.0 <= one <= 1.0 for one in seen)


@pytest.mark.parametrize(("bend", "could"), [(0.4, True), (0.8, False)])
def test_slopes_that_leave_a_good_part_of_the_work_are_followed_on(bend, could):
    """A lift does the work of a lift at another level, but not along one straight line."""
    allowed, form = np.full(4, 0.1), np.array([1.0, 1.0, -1.0, -1.0])
    slopes = -10.0 * (form + bend * np.array([1.0, -1.0, 1.0, -1.0]))[:, None]

    def is_within(left):
        return bool(np.all(np.abs(left) <= allowed))

    assert (
        could_others(3.0 * form, slopes, np.zeros(1), allowed, is_within, lambda at: 3.0 * form * (at[0] < 0.2))
        == could
    )


def test_others_that_cannot_be_there_do_no_work():
    form = np.ones(5)
    assert not could_others(form, -form[:, None], np.zeros(1), form, lambda left: not left.any(), lambda _: None)


def test_what_a_shift_of_the_others_does_in_a_whole_block_is_not_an_effects_own():
    allowed, late = np.array([1.0, 1.0, 2.0, 1.0]), np.array([30.0, -20.0, 10.0, 0.0])
    cells = SimpleNamespace(blocks=[SimpleNamespace(rows=np.arange(4), allowed=allowed)])
    assert np.abs(unshifted(cells, 0.5 * late, late)).max() < 0.02
    other = np.array([20.0, 30.0, 0.0, 5.0])
    assert unshifted(cells, other, late) == pytest.approx(other)
    assert np.abs(unshifted(cells, 50.0 * late, 1e-3 * late) - 50.0 * late).max() < 2.0, "it cannot be that late"
