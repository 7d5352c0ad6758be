"""The effects of the library, tried one by one: alone, and beside others."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import STRENGTHS, Candidate
from wetwell.sim2real.attribution.fitting import Fit, Fitter

Each = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""Applies a function to items, in order, as `map` does: perhaps side by side."""

PROBES = (0.002, 0.02)
"""Strengths, as shares of the range, by which a further effect is judged before it is fitted."""
MOST_FITTED = 8
"""Further effects that are fitted, the most promising first."""
MOST_REFINED = 4
LEAST_PROMISED = 10.0
"""Drop of the sum of squares under which a further effect is not fitted: it could not pay for its place."""
PROMISING = 0.02
"""Share of the best gain before refinement under which a candidate is not refined."""


class Trials:
    """Fits candidates to the training cycles.

    Parameters
    ----------
    fitter : Fitter
    guesses : mapping of Candidate to list of dict
        Where the search for each begins.
    progress : callable
        Gets the share of the work that is done, 0 to 1.
    each : callable
        Tries candidates, perhaps side by side: the replay holds no lock.
    """

    def __init__(
        self,
        fitter: Fitter,
        guesses: Mapping[Candidate, Sequence[Mapping[str, float]]],
        progress: Callable[[float], None],
        each: Each,
    ) -> None:
        self._fitter = fitter
        self._guesses = guesses
        self._progress = progress
        self._each = each

    def singles(self) -> list[Fit]:
        """Single effects, each with the pump or channel that fits best; the best effect first."""
        fitter, before = self._fitter, self._fitter.cost(self._fitter.plain)
        firsts: list[Fit] = []
        reach = fitter.reach(fitter.plain)
        tried = self._each(
            lambda candidate: fitter.first(candidate, self._start_grids(candidate), fitter.plain, reach),
            self._guesses,
        )
        for k, (fit, _) in enumerate(tried):
            firsts += [fit] if fit is not None else []
            self._progress(0.3 * (k + 1) / len(self._guesses))
        most = max((before - fitter.cost(fit) for fit in firsts), default=0.0)

        def refined(fit: Fit) -> Fit:
            gain = before - fitter.cost(fit)
            return fitter.refine(fit) if gain > PROMISING * most and gain > 0.0 else fit

        best: dict[tuple[str, ...], Fit] = {}
        for k, fit in enumerate(self._each(refined, firsts)):
            if fitter.cost(fit) < fitter.cost(best.get(fit.names)):
                best[fit.names] = fit
            self._progress(0.3 + 0.4 * (k + 1) / len(firsts))
        return sorted(best.values(), key=fitter.cost)

    def with_one_more(self, current: Fit) -> list[Fit]:
        """Fits of the current effects with one more, the most promising ones, each as the pump or channel it fits."""
        fitter = self._fitter
        reach = fitter.reach(current)
        free = [c for c in self._guesses if c.name not in current.names]
        promises = list(self._each(lambda candidate: self._promise(candidate, current, reach), free))
        promising: dict[str, tuple[float, Candidate]] = {}
        for promise, candidate in zip(promises, free, strict=True):
            if promise > max(LEAST_PROMISED, promising.get(candidate.name, (0.0, candidate))[0]):
                promising[candidate.name] = (promise, candidate)
        likely = [one for _, one in sorted(promising.values(), key=lambda pair: -pair[0])][:MOST_FITTED]
        tried = self._each(
            lambda candidate: fitter.first(candidate, self._start_grids(candidate), current, reach), likely
        )
        firsts = [fit for fit, _ in sorted(tried, key=lambda start: start[1]) if fit is not None]
        return list(self._each(partial(self._refined, current), firsts[:MOST_REFINED]))

    def _refined(self, current: Fit, fit: Fit) -> Fit:
        """A fit with one more effect, refined: where it ends worse than without that, from another start.

        The first start counts on what the others can reach, as if all were linear: a limit may promise much where a
        header would have to take back all that it explains. The other one is the best with the others as they stand.
        """
        fitter = self._fitter
        refined = fitter.refine(fit)
        if fitter.cost(refined) <= fitter.cost(current):
            return refined
        last, nothing = fit.candidates[-1], np.zeros((int(fitter.rows.sum()), 0))
        again, _ = fitter.first(last, self._start_grids(last), current, nothing)
        found = [refined] if again is None else [refined, fitter.refine(again)]
        return min(found, key=fitter.cost)

    def _start_grids(self, candidate: Candidate, strengths: Sequence[float] = STRENGTHS) -> list[list[Floats]]:
        """Points to begin at, each grid once: guesses that leave the strength open have the same ones."""
        grids = [grid for guess in self._guesses[candidate] for grid in candidate.start_grids(guess, strengths)]
        return list({b"".join(point.tobytes() for point in grid): grid for grid in grids}.values())

    def _promise(self, candidate: Candidate, current: Fit, reach: Floats) -> float:
        """Drop of the sum of squares that small trials of each strength promise, as if all were linear.

        What the current effects can reach they are fitted to again: a lag gives way to the inertia beside it.
        """
        rows = self._fitter.rows
        before = current.residuals[rows]
        most = 0.0
        for start in (point for grid in self._start_grids(candidate, PROBES) for point in grid):
            tried = self._fitter.at((*current.candidates, candidate), (*current.points, start))
            if tried is not None:
                change = tried.residuals[rows] - before
                change -= reach @ (reach.T @ change)
                along = max(-float(change @ before), 0.0)
                most = max(most, along**2 / max(float(change @ change), 1e-12))
        return most
