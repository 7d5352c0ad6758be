"""Where the parameters of a fit would be if one of them, which may have any value, were at an end of its range."""

from dataclasses import replace

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.attribution.fitting import Fit, Fitter

HALVES = (1.0, 0.5, 0.25)
"""Shares of the way to an end of its range at which a parameter is tried, while the recording speaks against it."""


def elsewhere(fitter: Fitter, fit: Fit, parameter: int, rise: float) -> list[Floats]:
    """(parameters,) points of all, fitted again with one of them held near either end of its range.

    Straight lines from the fit do not reach so far: an area at the floor goes with the exponent of the walls.

    Parameters
    ----------
    fitter : Fitter
    fit : Fit
    parameter : int
        The one that is held.
    rise : float
        Of the sum of squares, by which a recording speaks against a point.
    """
    here, limit, found = float(fit.position[parameter]), fitter.cost(fit) + rise, []
    for end in (0.0, 1.0):
        for share in HALVES:
            at = here + share * (end - here)
            held = _held(fitter, fit, parameter, at)
            if held is not None and fitter.cost(held) < limit:
                found.append(np.insert(held.position, parameter, at))
                break
    return found


def _held(fitter: Fitter, fit: Fit, parameter: int, at: float) -> Fit | None:
    """The fit with one of its parameters held at a point, the others refined; None where that cannot work."""
    candidates, points, first = [], [], 0
    for candidate, point in zip(fit.candidates, fit.points, strict=True):
        k = parameter - first
        is_its = 0 <= k < point.size
        candidates.append(_fixed(candidate, k, at) if is_its else candidate)
        points.append(np.delete(point, k) if is_its else point)
        first += point.size
    begun = fitter.at(candidates, points)
    return None if begun is None else fitter.refine(begun)


def _fixed(candidate: Candidate, parameter: int, at: float) -> Candidate:
    free = candidate.free[parameter]
    return replace(
        candidate,
        fixed=(*candidate.fixed, (free.name, free.value(at))),
        free=(*candidate.free[:parameter], *candidate.free[parameter + 1 :]),
    )
