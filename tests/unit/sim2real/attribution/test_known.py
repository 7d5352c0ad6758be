"""What is known before a fit: it is narrowed as by Bayes' theorem, and let go where the fit contradicts it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.attribution.known import FAR, Known, agreeing, known_of, narrowed
from wetwell.sim2real.likelihood.priors import EVEN, Priors


@given(st.integers(0, 10_000))
def test_narrowing_is_the_theorem_of_normal_distributions(seed):
    """Held against the product of two densities by their precisions."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    covariance = root @ root.T + 0.1 * np.eye(3)
    precision = rng.uniform(0.0, 20.0, 3) * rng.integers(0, 2, 3)
    after = narrowed(covariance, Known(mean=np.zeros(3), precision=precision))
    assert np.linalg.inv(after) == pytest.approx(np.linalg.inv(covariance) + np.diag(precision), rel=1e-6, abs=1e-6)


def test_what_a_fit_contradicts_is_let_go():
    known = Known(mean=np.array([0.5, 0.5]), precision=np.array([100.0, 100.0]))
    reach = FAR * np.hypot(0.1, 0.02)
    points = np.array([0.5 + 0.9 * reach, 0.5 + 1.1 * reach])
    assert agreeing(known, points, np.diag([0.02**2, 0.02**2])).precision.tolist() == [100.0, 0.0]


def test_a_parameter_that_nobody_knows_stays_even():
    (friction,) = candidates_of(1, 1, only=["friction_bias"])
    fit = Fit(candidates=(friction,), points=(np.full(len(friction.free), 0.5),), residuals=np.zeros(0))
    assert not known_of(fit, EVEN).precision.any()
    free = friction.free[0]
    told = known_of(fit, Priors(parameters={"friction_bias": {free.name: (1.2, 0.05)}}))
    assert told.mean[0] == pytest.approx(free.normalised(1.2))
    assert told.precision[0] == pytest.approx((2.0 / (free.normalised(1.25) - free.normalised(1.15))) ** 2, rel=1e-6)
