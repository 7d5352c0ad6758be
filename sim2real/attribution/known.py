"""What is known of the parameters of a fit before its recording, as points in their ranges."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.likelihood.priors import Priors

FAR = 3.0
"""Standard deviations, of fit and prior together, beyond which a station is not like the others. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """Normal distributions of (parameters,) points; the precision is 0 where nothing is known."""

    mean: Floats
    precision: Floats


def known_of(fit: Fit, priors: Priors) -> Known:
    """What a prior says of each free parameter of a fit, in the order of the candidates."""
    mean, precision = [], []
    for candidate in fit.candidates:
        told = priors.parameters.get(candidate.name, {})
        for free in candidate.free:
            centre, sd = told.get(free.name, (free.start, np.inf))
            centre = min(max(centre, free.low), free.high)
            low, high = (min(max(centre + side * sd, free.low), free.high) for side in (-1.0, 1.0))
            spread = (free.normalised(high) - free.normalised(low)) / 2.0
            mean.append(free.normalised(centre))
            precision.append(spread**-2.0 if np.isfinite(sd) and spread > 0.0 else 0.0)
    return Known(mean=np.array(mean), precision=np.array(precision))


def agreeing(known: Known, points: Floats, covariance: Floats) -> Known:
    """What is known without what a fit contradicts by more than `FAR`: the station is not like the others there."""
    with np.errstate(divide="ignore"):
        distance = np.abs(points - known.mean) / np.sqrt(np.diag(covariance) + 1.0 / known.precision)
    return Known(mean=known.mean, precision=np.where(distance <= FAR, known.precision, 0.0))


def narrowed(covariance: Floats, known: Known) -> Floats:
    r"""Covariance of points of which something is known: $C' = (I + C P)^{-1} C$ with the precision P."""
    size = known.precision.size
    return np.asarray(np.linalg.solve(np.eye(size) + covariance * known.precision, covariance), dtype=np.float64)
