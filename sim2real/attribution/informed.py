"""A fit that takes what other stations say of its parameters into account."""

import numpy as np

from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.intervals import covariance_of
from wetwell.sim2real.attribution.known import agreeing, known_of, narrowed
from wetwell.sim2real.likelihood.priors import Priors


def informed(fitter: Fitter, fit: Fit, priors: Priors) -> Fit:
    r"""The most probable fit under a normal prior of its parameters.

    $$x' = x + C' P (m - x), \qquad C' = (I + C P)^{-1} C$$

    with the points x of the fit, their covariance C as of `covariance_of`, and mean m and precision P of the prior,
    but for parameters that contradict it.

    Parameters
    ----------
    fitter : Fitter
    fit : Fit
    priors : Priors
        Without one for its parameters the fit stays as it is.
    """
    known, x = known_of(fit, priors), fit.position
    if not known.precision.any():
        return fit
    covariance = covariance_of(fitter, fit, fitter.bins, fitter.loss_slopes(fit)[fitter.rows])
    known = agreeing(known, x, covariance)
    step = narrowed(covariance, known) @ (known.precision * (known.mean - x))
    moved = fitter.at(fit.candidates, fit.split(np.clip(x + step, 0.0, 1.0)))
    return fit if moved is None else moved
