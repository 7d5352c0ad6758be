"""Whether an effect is there: the recording needs it, and no other does the same."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from wetwell.sim2real.attribution.presence import SURE, are_needed, own_signature, unshifted
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


def test_what_a_shift_of_the_others_does_in_a_whole_block_is_not_an_effects_own():
    allowed, late = np.array([1.0, 1.0, 2.0, 1.0]), np.array([30.0, -20.0, 10.0, 0.0])
    cells = SimpleNamespace(blocks=[SimpleNamespace(rows=np.arange(4), allowed=allowed)])
    assert np.abs(unshifted(cells, 0.5 * late, late)).max() < 0.02
    other = np.array([20.0, 30.0, 0.0, 5.0])
    assert unshifted(cells, other, late) == pytest.approx(other)
    assert np.abs(unshifted(cells, 50.0 * late, 1e-3 * late) - 50.0 * late).max() < 2.0, "it cannot be that late"
