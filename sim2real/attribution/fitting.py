"""Bounded least squares under the asinh loss, for any set of effects at once."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import lsq_linear

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.candidates import STRENGTHS, Candidate
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import asinh_loss, residuals_of, steepness, weights_of
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects.effect import Effect

SLOPE_STEP = 1e-3
"""Of the differences that make the slopes, as a share of a parameter's range."""
ROUNDS = 12
KEPT = 0.01
"""Share of what its slopes promise by which a step has to lead down; else a shorter one is tried. [1]"""
LEAST_DAMPING = 1e-6
"""Of a step, so that two parameters that do the same have one. [1]"""
DAMPINGS = 5
"""Steps of a round, each damped more and shorter, of which one has to lead down."""
LONGEST_STEP, SHORTER = 0.3, 0.5
"""Of a parameter over its range, the longest step of a round, and each further one over the last. [1]"""
SETTLED = 1e-3
MOST_AWAY = 2
"""Points of a grid, one after the other, that lead away, after which it is left."""
SCANS = ((0.4, 0.55, 0.75, 1.35, 1.8, 2.5), (0.8, 0.9, 1.1, 1.25), (0.95, 1.05))


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Candidates at their best points; residuals of all bins, in units of noise, as `asinh_loss` makes them."""

    candidates: tuple[Candidate, ...]
    points: tuple[Floats, ...]
    residuals: Floats

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects themselves, as they are in the last period."""
        return tuple(c.effect(point) for c, point in zip(self.candidates, self.points, strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(candidate.name for candidate in self.candidates)

    @property
    def position(self) -> Floats:
        """(parameters,) points of all candidates, one after the other."""
        return np.concatenate(self.points) if self.points else np.zeros(0)

    def split(self, position: Floats) -> tuple[Floats, ...]:
        """Rows of each candidate, of points or of what there is for each parameter."""
        return tuple(np.split(position, np.cumsum([point.size for point in self.points])[:-1]))


class Fitter:
    """Fits candidates to the chosen bins of a recording.

    Attributes
    ----------
    rows : (bins,) array
        Those that are fitted.
    bins : Bins
    plant : PlantParameters
        The station as it is.
    station : Station
        As its file says.
    plain : Fit
        Without any effect.
    periods : int
        Recordings that were left alone.
    half_step_m : float
        As of the residuals. [m]
    """

    def __init__(self, replay: Replay, residuals: StationResiduals, rows: Flags) -> None:
        self._replay = replay
        self._residuals = residuals
        self.rows = rows
        self.bins = residuals.bins
        self.half_step_m = residuals.half_step_m
        self.station = replay.station
        self.periods = int(replay.period[-1]) + 1
        prediction = replay.run()
        self.plant = prediction.plant
        self.plain = Fit(candidates=(), points=(), residuals=asinh_loss(residuals.of(prediction)))

    def at(self, candidates: Sequence[Candidate], points: Sequence[Floats]) -> Fit | None:
        """Candidates at their points, None where the effects cannot work together on this station."""
        try:
            prediction = self._replay.run([c.acting(point) for c, point in zip(candidates, points, strict=True)])
        except ValueError:
            return None
        residuals = asinh_loss(self._residuals.of(prediction))
        return Fit(candidates=tuple(candidates), points=tuple(points), residuals=residuals)

    def without(self, fit: Fit, member: int) -> Fit | None:
        """A fit without one of its effects, the others where they stand."""
        return self._some(fit, [k for k in range(len(fit.candidates)) if k != member])

    def only(self, fit: Fit, names: Collection[str]) -> Fit | None:
        """A fit with some of its effects, by name, where they stand."""
        return self._some(fit, [k for k, name in enumerate(fit.names) if name in names])

    def _some(self, fit: Fit, members: Sequence[int]) -> Fit | None:
        return self.at([fit.candidates[k] for k in members], [fit.points[k] for k in members])

    def cost(self, fit: Fit | None) -> float:
        """Sum of squares over the bins that are fitted."""
        return float("inf") if fit is None else float(np.sum(fit.residuals[self.rows] ** 2))

    def along(
        self, candidate: Candidate, start_grids: Sequence[Sequence[Floats]], beside: Fit | None = None
    ) -> list[Fit]:
        """A candidate at several starts, alone or beside others.

        Of a grid of rising strength those are left out that are far from what the one before makes likely, as if all
        were linear; a grid that leads away is left. A limit is not: readings pass it one by one, so each is tried.
        """
        found, beside = [], beside or self.plain
        for grid in start_grids:
            place, away = 0, 0
            while place < len(grid) and away < MOST_AWAY:
                tried = self.at((*beside.candidates, candidate), (*beside.points, grid[place]))
                if tried is None:
                    break
                scale = self._best_scale(beside, tried)
                found.append(tried)
                away = away + 1 if scale <= 0.0 else 0
                place = place + 1 if away or candidate.is_limit else _next_place(place, scale, len(grid))
        return found

    def _best_scale(self, before: Fit, tried: Fit) -> float:
        """Times the change that an effect makes at which it fits best, as if all were linear."""
        left = residuals_of(before.residuals[self.rows])
        change = residuals_of(tried.residuals[self.rows]) - left
        weighed = weights_of(left) * change
        squares = float(weighed @ change)
        return -float(weighed @ left) / squares if squares > 0.0 else np.inf

    def refine(self, fit: Fit) -> Fit:
        """Where a fit leads down to, in the form that fits best there."""
        found = self._descended(fit)
        formed = self._in_best_form(found)
        return found if formed is found else self._descended(formed)

    def _descended(self, fit: Fit) -> Fit:
        """Levenberg and Marquardt's method from where a fit stands, within the ranges.

        Limits have no slope that leads anywhere: where that ends they are tried nearer to neutral and further off,
        and it goes on from there. So are the strengths of the last candidate where nothing led down.
        """
        if fit.position.size == 0:
            return fit
        current, damping = fit, 1e-2
        is_limit = np.concatenate(
            [np.full(p.size, c.is_limit) for c, p in zip(fit.candidates, fit.points, strict=True)]
        )
        is_last = np.arange(is_limit.size) >= is_limit.size - fit.points[-1].size
        for _ in range(ROUNDS):
            slopes = self._differences(current, np.asarray)[self.rows]
            gradient = slopes.T @ current.residuals[self.rows]
            squares = slopes.T @ slopes
            x = current.position
            is_bound = ((x <= 0.0) & (gradient > 0.0)) | ((x >= 1.0) & (gradient < 0.0)) | (np.diag(squares) <= 0.0)
            is_free, moved = ~(is_bound | is_limit), None
            if is_free.any():
                moved, damping = self._moved(current, gradient, squares, is_free, damping)
            if moved is None or self.cost(current) - self.cost(moved) < SETTLED * self.cost(moved):
                its = current if moved is None else moved
                moved = self._scanned(its, is_limit | is_last if its is fit else is_limit)
                if moved is its:
                    return its
            current = moved
        return current

    def _moved(
        self, fit: Fit, gradient: Floats, squares: Floats, is_free: Flags, damping: float
    ) -> tuple[Fit | None, float]:
        """First of some steps, each damped more and shorter, that leads down, and the damping of the next round.

        No parameter goes further than a step is long, nor out of its range, and the others make the best of that.
        """
        inner, x = squares[np.ix_(is_free, is_free)], fit.position
        for place in range(DAMPINGS):
            root = np.linalg.cholesky(inner + damping * np.diag(np.diag(inner)))
            longest = LONGEST_STEP * SHORTER**place
            room = np.maximum(-x, -longest)[is_free], np.minimum(1.0 - x, longest)[is_free]
            step = np.zeros(is_free.size)
            step[is_free] = lsq_linear(root.T, -solve_triangular(root, gradient[is_free], lower=True), room).x
            promised = -float(2.0 * gradient @ step + step @ squares @ step)
            tried = self.at(fit.candidates, fit.split(np.clip(x + step, 0.0, 1.0)))
            if self.cost(fit) - self.cost(tried) > max(KEPT * promised, 0.0):
                return tried, max(damping / 6.0, LEAST_DAMPING)
            damping *= 6.0
        return None, damping

    def _scanned(self, fit: Fit, is_tried: Flags) -> Fit:
        """Fit with some parameters, where they are strengths, nearer to neutral and further off."""
        best = fit
        neutral = np.concatenate([c.neutral(point) for c, point in zip(fit.candidates, fit.points, strict=True)])
        for k in np.flatnonzero(is_tried & (neutral != fit.position)):
            for factors in SCANS:
                start = best.position
                for factor in factors:
                    position = start.copy()
                    position[k] = min(max(neutral[k] + factor * (start[k] - neutral[k]), 0.0), 1.0)
                    tried = self.at(fit.candidates, fit.split(position))
                    if tried is not None and self.cost(tried) < self.cost(best):
                        best = tried
        return best

    def _in_best_form(self, fit: Fit) -> Fit:
        """Fit with each parameter that has forms in the one that fits best, if that is not where it stands."""
        best = fit
        for k, free in enumerate(free for candidate in fit.candidates for free in candidate.free):
            for form in free.forms:
                position = best.position.copy()
                position[k] = free.normalised(form)
                tried = self.at(fit.candidates, fit.split(position))
                if tried is not None and self.cost(tried) < self.cost(best):
                    best = tried
        return best

    def slopes(self, fit: Fit) -> Floats:
        """(bins, parameters) change of the residuals themselves with each parameter, over its range.

        The noise is no part of it: what was measured is the same on both sides of a difference.
        """
        return self._differences(fit, residuals_of)

    def loss_slopes(self, fit: Fit) -> Floats:
        """(bins, parameters) change of the losses with each parameter, over its range."""
        return np.asarray(self.slopes(fit) * steepness(fit.residuals)[:, None], dtype=np.float64)

    def _differences(self, fit: Fit, of: Callable[[Floats], Floats]) -> Floats:
        """(bins, parameters) differences of something of the losses, over steps of the parameters."""
        x = fit.position
        slopes = np.zeros((self.rows.size, x.size))
        for k in range(x.size):
            for step in (SLOPE_STEP, -SLOPE_STEP) if x[k] < 0.5 else (-SLOPE_STEP, SLOPE_STEP):
                moved = x.copy()
                moved[k] += step
                beside = self.at(fit.candidates, fit.split(moved))
                if beside is not None:
                    slopes[:, k] = (of(beside.residuals) - of(fit.residuals)) / step
                    break
        return slopes


def _next_place(place: int, scale: float, size: int) -> int:
    """Of the strengths behind one in a grid the one nearest to so many times that; the end, where that is nearer."""
    wanted = np.log(scale * STRENGTHS[place])
    away = np.abs(np.log(STRENGTHS[place:size]) - wanted)
    return size if np.argmin(away) == 0 else place + int(np.argmin(away))
