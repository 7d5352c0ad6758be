"""Whether an interval says how large an effect is."""

import numpy as np
import pytest

from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.attribution.intervals import are_sized


def fit_of(*names):
    candidates = tuple(candidates_of(1, 1, only=[name])[0] for name in names)
    points = tuple(np.full(len(one.free), 0.5) for one in candidates)
    return Fit(candidates=candidates, points=points, residuals=np.zeros(0))


@pytest.mark.parametrize(
    ("low", "high", "is_sized"), [(0.4, 0.6, True), (0.0, 0.6, False), (0.0, 1.0, False), (0.02, 1.0, True)]
)
def test_an_only_strength_must_not_be_neutral(low, high, is_sized):
    """A leak of 0 is none. One of which only the least is known is there."""
    fit = fit_of("check_valve_leak")
    ends = np.array([[low, high] if free.neutral is not None else [0.0, 1.0] for free in fit.candidates[0].free])
    assert are_sized(fit, ends) is is_sized


def test_of_several_strengths_one_may_be_neutral_and_what_is_no_strength_may_be_anything():
    fit = fit_of("pump_wear", "check_valve_leak")
    wear = [[0.0, 1.0] for _ in fit.candidates[0].free]
    leak = [[0.2, 0.3] if free.neutral is not None else [0.0, 1.0] for free in fit.candidates[1].free]
    assert are_sized(fit, np.array(wear + leak))
    assert not are_sized(fit, np.array([*wear, [0.0, 0.3], *leak[1:]]))


def test_nothing_has_no_size_to_be_told():
    assert are_sized(Fit(candidates=(), points=(), residuals=np.zeros(0)), np.zeros((0, 2)))
