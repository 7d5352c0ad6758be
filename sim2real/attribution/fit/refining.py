"""Levenberg and Marquardt's method within the ranges, under the loss of the bins or the covariance of the cells."""

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.fit.fitting import Fit, Fitter
from wetwell.sim2real.attribution.fit.objective import Objective, loss

ROUNDS = 12
DAMPINGS = 5
"""Steps of a round, each damped more, of which one has to lead down."""
LONGEST_STEP = 0.3
SCANS = ((0.4, 0.55, 0.75, 1.35, 1.8, 2.5), (0.8, 0.9, 1.1, 1.25), (0.95, 1.05))


def refined(fitter: Fitter, fit: Fit, objective: Objective | None = None, slopes: Floats | None = None) -> Fit:
    """The fit at its best near where it stands; itself, where it is there.

    Parameters
    ----------
    fitter : Fitter
    fit : Fit
    objective : Objective, optional
        Default: the loss of the rows that are fitted.
    slopes : (k, parameters) array, optional
        Of what the objective sees, at the fit, where they are known.
    """
    objective = loss(fitter.rows) if objective is None else objective
    if fit.position.size == 0:
        return fit
    current, left, damping = fit, _left(fit, objective), 1e-2
    for _ in range(ROUNDS):
        if current is not fit or slopes is None:
            slopes = fitter.differences(current, objective.seen)
        inner = objective.products(np.column_stack([objective.seen(current.residuals), slopes]))
        gradient, squares = inner[1:, 0], inner[1:, 1:]
        x = current.position
        is_bound = ((x <= 0.0) & (gradient > 0.0)) | ((x >= 1.0) & (gradient < 0.0)) | (np.diag(squares) <= 0.0)
        if is_bound.all():
            return _scanned(fitter, current, objective)
        is_flat = not np.all(np.diag(squares)[-fit.points[-1].size :])
        if objective.is_settled(_promised(gradient, squares, ~is_bound), left):
            return _scanned(fitter, fit, objective) if current is fit and is_flat else current
        moved, damping = _moved(fitter, current, objective, gradient, squares, ~is_bound, damping)
        if moved is None:
            return _scanned(fitter, fit, objective) if current is fit else current
        before, left = left, _left(moved, objective)
        current = moved
        if objective.is_settled(before - left, left):
            break
    return current


def _promised(gradient: Floats, squares: Floats, is_free: Flags) -> float:
    """What a step to the best of a straight model would take."""
    its = gradient[is_free]
    return float(its @ np.linalg.pinv(squares[np.ix_(is_free, is_free)]) @ its)


def _left(fit: Fit | None, objective: Objective) -> float:
    if fit is None:
        return float("inf")
    return float(objective.products(objective.seen(fit.residuals)[:, None])[0, 0])


def _moved(
    fitter: Fitter,
    fit: Fit,
    objective: Objective,
    gradient: Floats,
    squares: Floats,
    is_free: Flags,
    damping: float,
) -> tuple[Fit | None, float]:
    """First of some steps, each damped more, that leads down, and the damping of the next round."""
    inner, left = squares[np.ix_(is_free, is_free)], _left(fit, objective)
    for _ in range(DAMPINGS):
        step = np.zeros(is_free.size)
        step[is_free] = -np.linalg.solve(inner + damping * np.diag(np.diag(inner)), gradient[is_free])
        position = np.clip(fit.position + np.clip(step, -LONGEST_STEP, LONGEST_STEP), 0.0, 1.0)
        tried = fitter.at(fit.candidates, fit.split(position))
        if _left(tried, objective) < left:
            return tried, damping / 6.0
        damping *= 6.0
    return None, damping


def _scanned(fitter: Fitter, fit: Fit, objective: Objective) -> Fit:
    """Fit with the last candidate's strengths tried nearer to neutral and further off: limits have no slope."""
    best, least = fit, _left(fit, objective)
    for k, free in enumerate(fit.candidates[-1].free):
        if free.neutral is None:
            continue
        neutral = free.normalised(free.neutral)
        for factors in SCANS:
            start = best.points[-1]
            for factor in factors:
                point = start.copy()
                point[k] = min(max(neutral + factor * (start[k] - neutral), 0.0), 1.0)
                tried = fitter.at(fit.candidates, (*fit.points[:-1], point))
                if tried is not None and (left := _left(tried, objective)) < least:
                    best, least = tried, left
    return best
