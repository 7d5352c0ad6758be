"""Whether an effect is there: all its strengths at once, not one by one."""

import numpy as np
import pytest

from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.attribution.presence import are_there, own_signature
from wetwell.sim2real.likelihood.evidence import Evidence


def found(precision):
    count = precision.shape[0]
    return Evidence(
        log=0.0, by_block=np.zeros(0), residuals=np.zeros(0), step=np.zeros(count), precision=precision, stirred=()
    )


def fit_of(name, move):
    """A fit of the first candidate of a name, its strengths moved from neutral by shares of their ranges."""
    candidate = next(one for one in candidates_of(1, 1) if one.name == name)
    neutral = [0.5 if free.neutral is None else free.normalised(free.neutral) for free in candidate.free]
    point = np.array(neutral) + np.array(move[: len(neutral)])
    return Fit(candidates=(candidate,), points=(np.clip(point, 0.0, 1.0),), residuals=np.zeros(0))


@pytest.mark.parametrize(("deviation", "expected"), [(0.01, True), (0.2, False)])
def test_one_strength_has_to_be_away_from_neutral(deviation, expected):
    fit = fit_of("friction_bias", [0.1])
    assert are_there(fit, found(np.eye(fit.position.size) / deviation**2)) is expected


def test_two_strengths_that_take_each_others_place_are_there_together():
    """Each alone may as well be neutral, both at once may not."""
    fit = fit_of("pump_wear", [-0.1, 0.1])
    assert fit.position.size == 2
    along, across = np.array([1.0, 1.0]) / np.sqrt(2.0), np.array([1.0, -1.0]) / np.sqrt(2.0)
    precision = np.outer(along, along) / 0.5**2 + np.outer(across, across) / 0.01**2
    spread = np.sqrt(np.diag(np.linalg.inv(precision)))
    assert np.all(1.96 * spread > 0.1)
    assert are_there(fit, found(precision))


def test_a_limit_without_a_slope_is_there_where_it_is_not_neutral():
    assert are_there(fit_of("flow_low_cutoff", [0.2]), found(np.zeros((1, 1))))
    assert not are_there(fit_of("flow_low_cutoff", [0.0]), found(np.zeros((1, 1))))


def test_of_two_effects_that_undo_each_other_neither_has_anything_of_its_own():
    rng = np.random.default_rng(6)
    form, allowed = rng.normal(size=50), rng.uniform(0.5, 2.0, 50)
    small = 0.01 * rng.normal(size=50)
    left = own_signature(40.0 * form + small, -form[:, None], allowed)
    assert np.linalg.norm(left) <= 1.01 * np.linalg.norm(small) * allowed.max() / allowed.min()
    apart = rng.normal(size=50)
    assert np.linalg.norm(own_signature(apart, -form[:, None], allowed)) > 0.8 * np.linalg.norm(apart)
    assert np.array_equal(own_signature(apart, np.zeros((50, 0)), allowed), apart)
