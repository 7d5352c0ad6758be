"""Parameters from a prior and from values that come in runs: the most probable ones, and how sure they are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.calibration.fit.prior import Prior
from wetwell.sim2real.calibration.fit.run_noise import RunNoise

MOST_STEPS = 60
FARTHEST = 0.5
"""How far a parameter may move in one step, in standard deviations of its prior."""
NEAREST = 1e-4
"""Change of all parameters at which the fit ends, in standard deviations of the prior."""
TOLD = 0.9
"""Standard deviation after over before the recording, from which on the recording tells nothing of a parameter."""

Errors = Callable[[Floats], Sequence[tuple[Floats, Floats]]]
"""Relative errors of each kind of value, (n,), and their slopes over the parameters, (n, parameters)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """What a recording tells of parameters.

    Attributes
    ----------
    value : (parameters,) array
        Most probable; a parameter that the recording does not tell stands at the mean of its prior.
    covariance : (parameters, parameters) array
        Of all of them, those that are not told too.
    prior : Prior
    is_told : (parameters,) bool array
        Whether the recording has made a parameter surer than its prior, see `TOLD`.
    """

    value: Floats
    covariance: Floats
    prior: Prior
    is_told: Flags

    @property
    def sd(self) -> Floats:
        """(parameters,) standard deviations."""
        deviation: Floats = np.sqrt(np.diag(self.covariance))
        return deviation


def regularised_fit(errors: Errors, runs: Sequence[Integers], is_lossy: Sequence[bool], prior: Prior) -> Posterior:
    r"""Most probable parameters, by Gauss and Newton.

    $$\min_\theta \sum_c \sum_j \frac{w_{cj}}{\sigma_c^2}\, e_{cj}(\theta)^2
    + (\theta - \theta_0)^T P^{-1} (\theta - \theta_0), \qquad
    C = \left(\sum_c J_c^T W_c J_c / \sigma_c^2 + P^{-1}\right)^{-1}$$

    over the kinds c of values. The σ, and the weights for outliers and runs, are estimated from the errors at each
    step. What the recording hardly tells is then put back to the mean of its prior and the rest fitted once more.

    Parameters
    ----------
    errors : function
    runs : sequence of (n,) int arrays
        Runs of the values of each kind, from 0 without a gap; no kind, and the prior comes back.
    is_lossy : sequence of bool
        Whether values of each kind can be lost but not gained, see `RunNoise.of_errors`.
    prior : Prior
    """
    everything = np.ones(prior.mean.size, dtype=bool)
    value, covariance = _settled(errors, runs, is_lossy, prior, everything)
    is_told = np.sqrt(np.diag(covariance)) < TOLD * prior.sd
    if is_told.any() and not is_told.all():
        value, _ = _settled(errors, runs, is_lossy, prior, is_told)
    return Posterior(value=np.where(is_told, value, prior.mean), covariance=covariance, prior=prior, is_told=is_told)


def _settled(
    errors: Errors, runs: Sequence[Integers], is_lossy: Sequence[bool], prior: Prior, free: Flags
) -> tuple[Floats, Floats]:
    """Parameters of which the free ones have moved, and the covariance of all; steps are in units of the prior."""
    unit = prior.sd
    correlation = prior.covariance / np.outer(unit, unit)
    precision: Floats = np.asarray(np.linalg.inv(correlation), dtype=np.float64)
    least = 1.0 / float(np.linalg.eigvalsh(correlation)[-1])
    value, covariance = prior.mean.copy(), correlation
    values = sum(run.size for run in runs)
    fitted = 0.0
    for _ in range(MOST_STEPS if values else 0):
        told: Floats = np.zeros_like(precision)
        pull: Floats = precision @ ((prior.mean - value) / unit)
        for run, lossy, (error, slope) in zip(runs, is_lossy, errors(value), strict=True):
            noise = RunNoise.of_errors(error, run, fitted * run.size / values, is_lossy=lossy)
            jacobian = noise.whitened(slope * unit)
            told += jacobian.T @ jacobian
            pull -= jacobian.T @ noise.whitened(error)
        normal = precision + told
        covariance = _inverse(normal, least)
        fitted = float(np.trace(covariance @ told))
        moving = free & ~((value <= prior.lowest) & (pull < 0.0))
        step = np.zeros_like(value)
        step[moving] = _inverse(normal[np.ix_(moving, moving)], least) @ pull[moving]
        longest = float(np.max(np.abs(step)))
        value = np.maximum(value + step * unit * min(1.0, FARTHEST / max(longest, NEAREST)), prior.lowest)
        if longest < NEAREST:
            break
    return value, covariance * np.outer(unit, unit)


def _inverse(precision: Floats, least: float) -> Floats:
    """Inverse of a precision that is in no direction under that of the prior, also where it has lost its digits."""
    size, directions = np.linalg.eigh(precision)
    inverse: Floats = (directions / np.maximum(size, least)) @ directions.T
    return inverse
