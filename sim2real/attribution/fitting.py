"""Bounded least squares with soft residuals, for any set of effects at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.residuals import Misfit, soft
from wetwell.simulator.effects.effect import Effect

STEP = 1e-3
"""Of the differences that make the slopes, as a share of a parameter's range."""
ROUNDS = 12
SETTLED = 1e-3
MOST_AWAY = 2
"""Steps up a ladder, each worse than the best before, after which it is left."""
STAYED = 0.01
"""Share of its range by which a strength may move and still count as neutral."""
SCANS = ((0.4, 0.55, 0.75, 1.35, 1.8, 2.5), (0.8, 0.9, 1.1, 1.25), (0.95, 1.05))


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Candidates at their best places; residuals of all bins, soft, in units of noise."""

    candidates: tuple[Candidate, ...]
    places: tuple[Floats, ...]
    residuals: Floats

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects themselves."""
        return tuple(c.effect(place) for c, place in zip(self.candidates, self.places, strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(candidate.name for candidate in self.candidates)

    @property
    def free(self) -> int:
        """Number of free parameters, but for strengths that have stayed neutral."""
        return sum(
            free.neutral is None or abs(float(share) - free.share(free.neutral)) > STAYED
            for candidate, place in zip(self.candidates, self.places, strict=True)
            for free, share in zip(candidate.free, place, strict=True)
        )


class Fitter:
    """Fits candidates to the chosen bins of a recording."""

    def __init__(self, replay: Replay, misfit: Misfit, rows: Flags) -> None:
        self._replay = replay
        self._misfit = misfit
        self.rows = rows

    def residuals(self, candidates: Sequence[Candidate], places: Sequence[Floats]) -> Floats | None:
        """(bins,) soft residuals, None where the effects cannot work together on this station."""
        try:
            prediction = self._replay.run([c.effect(place) for c, place in zip(candidates, places, strict=True)])
        except ValueError:
            return None
        return soft(self._misfit.residuals(prediction))

    def left(self, effects: Sequence[Effect], excused_s: int) -> Floats:
        """(bins,) soft residuals under effects, with short transients in ramps excused."""
        return soft(self._misfit.residuals(self._replay.run(effects), excused_s))

    def cost(self, residuals: Floats | None) -> float:
        """Sum of squares over the bins that are fitted."""
        return float("inf") if residuals is None else float(np.sum(residuals[self.rows] ** 2))

    def first(
        self, candidate: Candidate, ladders: Sequence[Sequence[Floats]], others: Fit | None = None
    ) -> Fit | None:
        """Best of several starts, without refinement; a ladder is left when it has led away from the recording."""
        best: Fit | None = None
        before = () if others is None else others.candidates
        places = () if others is None else others.places
        for ladder in ladders:
            lowest, away = float("inf"), 0
            for start in ladder:
                residuals = self.residuals((*before, candidate), (*places, start))
                cost = self.cost(residuals)
                away = away + 1 if cost > lowest else 0
                lowest = min(lowest, cost)
                if residuals is not None and (best is None or cost < self.cost(best.residuals)):
                    best = Fit(candidates=(*before, candidate), places=(*places, start), residuals=residuals)
                if away == MOST_AWAY:
                    break
        return best

    def refine(self, fit: Fit, rounds: int = ROUNDS) -> Fit:
        """Levenberg and Marquardt's method from where a fit stands, within the ranges."""
        sizes = [place.size for place in fit.places]
        x = np.concatenate([*fit.places]) if fit.places else np.zeros(0)
        if x.size == 0:
            return fit
        residuals, damping = fit.residuals, 1e-2
        cost = self.cost(residuals)
        for _ in range(rounds):
            slopes = self._slopes(fit.candidates, x, sizes, residuals)
            gradient = slopes.T @ residuals[self.rows]
            squares = slopes.T @ slopes
            held = ((x <= 0.0) & (gradient > 0.0)) | ((x >= 1.0) & (gradient < 0.0)) | (np.diag(squares) <= 0.0)
            if held.all():
                return self._scanned(fit)
            moved = False
            for _ in range(5):
                step = np.zeros(x.size)
                free = ~held
                inner = squares[np.ix_(free, free)]
                step[free] = -np.linalg.solve(inner + damping * np.diag(np.diag(inner)), gradient[free])
                trial = np.clip(x + np.clip(step, -0.3, 0.3), 0.0, 1.0)
                tried = self.residuals(fit.candidates, np.split(trial, np.cumsum(sizes)[:-1]))
                if self.cost(tried) < cost:
                    moved = True
                    break
                damping *= 6.0
            if not moved or tried is None:
                return self._scanned(fit) if residuals is fit.residuals else self._at(fit, x, sizes, residuals)
            gain = cost - self.cost(tried)
            x, residuals, cost, damping = trial, tried, self.cost(tried), damping / 6.0
            if gain < SETTLED * cost:
                break
        return self._at(fit, x, sizes, residuals)

    @staticmethod
    def _at(fit: Fit, x: Floats, sizes: list[int], residuals: Floats) -> Fit:
        return Fit(candidates=fit.candidates, places=tuple(np.split(x, np.cumsum(sizes)[:-1])), residuals=residuals)

    def _scanned(self, fit: Fit) -> Fit:
        """Fit with the last candidate's strengths tried nearer to neutral and further off: limits have no slope."""
        candidate, best = fit.candidates[-1], fit
        for k, free in enumerate(candidate.free):
            if free.neutral is None:
                continue
            neutral = free.share(free.neutral)
            for factors in SCANS:
                start = best.places[-1]
                for factor in factors:
                    place = start.copy()
                    place[k] = min(max(neutral + factor * (start[k] - neutral), 0.0), 1.0)
                    residuals = self.residuals(fit.candidates, (*fit.places[:-1], place))
                    if residuals is not None and self.cost(residuals) < self.cost(best.residuals):
                        best = Fit(candidates=fit.candidates, places=(*fit.places[:-1], place), residuals=residuals)
        return best

    def slopes(self, fit: Fit) -> Floats:
        """(fitted bins, parameters) change of the residuals with each place."""
        return self._slopes(
            fit.candidates, np.concatenate([*fit.places]), [place.size for place in fit.places], fit.residuals
        )

    def _slopes(self, candidates: Sequence[Candidate], x: Floats, sizes: list[int], residuals: Floats) -> Floats:
        slopes = np.zeros((int(self.rows.sum()), x.size))
        for k in range(x.size):
            for step in (STEP, -STEP) if x[k] < 0.5 else (-STEP, STEP):
                moved = x.copy()
                moved[k] += step
                beside = self.residuals(candidates, np.split(moved, np.cumsum(sizes)[:-1]))
                if beside is not None:
                    slopes[:, k] = (beside[self.rows] - residuals[self.rows]) / step
                    break
        return slopes
