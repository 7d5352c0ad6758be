"""Whether each effect of a set is there, by what the likelihood leaves open of its strengths."""

import numpy as np
from scipy.special import gammaincinv

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.likelihood.evidence import Evidence

SURE = 0.95
"""Probability of the region of an effect's strengths that must not hold neutral. [1]"""
LEAST_KNOWN = 1.0
"""Precision from which a parameter is known at all: a standard deviation of its whole range."""


def are_there(fit: Fit, found: Evidence) -> bool:
    r"""Whether no effect's strengths may all be neutral at once.

    $$(x - x_0)^T \Sigma^{-1} (x - x_0) > \chi^2_{.95}$$

    with the strengths x, their neutral values, and the covariance Σ of the likelihood, all other parameters free.
    A strength without a slope, such as a limit, is there where it is not neutral; its signature tells its worth.

    Parameters
    ----------
    fit : Fit
    found : Evidence
        Its parameters are those of the fit.
    """
    is_known = np.diag(found.precision) > LEAST_KNOWN
    covariance = np.zeros_like(found.precision)
    among = np.ix_(is_known, is_known)
    covariance[among] = np.linalg.pinv(found.precision[among])
    for neutral in strengths_of(fit):
        place = np.array(list(neutral), dtype=np.int64)
        away = found.step[place] - np.array(list(neutral.values()))
        if place.size and not _is_away(away, covariance[np.ix_(place, place)], is_known[place]):
            return False
    return True


def strengths_of(fit: Fit) -> list[dict[int, float]]:
    """Of each effect the way from each of its strengths, by number, to neutral, over its range."""
    found, first, position = [], 0, fit.position
    for candidate in fit.candidates:
        found.append(
            {
                first + k: free.normalised(free.neutral) - float(position[first + k])
                for k, free in enumerate(candidate.free)
                if free.neutral is not None
            }
        )
        first += len(candidate.free)
    return found


def own_signature(signature: Floats, others: Floats, allowed: Floats) -> Floats:
    r"""What of an effect's signature is left once the others of its set are fitted in its place.

    $$f - J \hat x, \qquad \hat x = \arg\min_x \sum_i \left(\frac{f_i - (J x)_i}{a_i}\right)^2$$

    A friction that is too high beside a lift that is too low may do next to nothing, though each does much.

    Parameters
    ----------
    signature : (cells,) array
        f, what the effect explains.
    others : (cells, parameters) array
        J, change of the residuals with each parameter of the others.
    allowed : (cells,) array
        a, size under which a difference is none.
    """
    change = np.linalg.lstsq(others / allowed[:, None], signature / allowed, rcond=None)[0]
    return np.asarray(signature - others @ change, dtype=np.float64)


def time_constant_s(fit: Fit, member: int) -> float:
    """Seconds of the longest strength of an effect that is a time, such as a lag; 0 without any."""
    return max(_times_s(fit, member), default=0.0)


def is_only_late(fit: Fit, member: int, time_s: float) -> bool:
    """Whether an effect only lets something come late, by a time that is not material."""
    times = _times_s(fit, member)
    strengths = sum(free.neutral is not None for free in fit.candidates[member].free)
    return 0 < strengths == len(times) and max(times) <= time_s


def _times_s(fit: Fit, member: int) -> list[float]:
    candidate, point = fit.candidates[member], fit.points[member]
    return [
        abs(free.value(float(one)) - free.neutral)
        for free, one in zip(candidate.free, point, strict=True)
        if free.unit == "s" and free.neutral is not None
    ]


def _is_away(away: Floats, covariance: Floats, is_known: Flags) -> bool:
    if np.any(away[~is_known] != 0.0):
        return True
    inverse = np.linalg.pinv(covariance[np.ix_(is_known, is_known)])
    square = float(away[is_known] @ inverse @ away[is_known])
    quantile = 2.0 * float(gammaincinv(is_known.sum() / 2.0, SURE))  # of χ²; scipy.stats would take .3 s to load
    return square > quantile
