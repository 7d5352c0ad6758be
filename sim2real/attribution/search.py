"""The search for sets of effects: one more, each member exchanged, and strengths that change between recordings."""

from collections.abc import Iterable, Sequence

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.hypotheses import Hypotheses
from wetwell.sim2real.attribution.trials import Each, Trials
from wetwell.sim2real.likelihood.posterior import SetProbability
from wetwell.simulator.effects import EFFECTS

MOST_EFFECTS = 4
"""Effects of a set: three, and the inertia that the water of each main has."""

MANY_EFFECTS = 3
"""Effects of a set that may do the work of fewer, one of which was never tried beside the others. Of the search only:
a set of fewer is not looked at anew, for the time that it takes."""

MOST_EXTENDED = 2
"""Sets of each size beside which one more effect is tried: a pair may be right that is less probable than many
triples."""

MOST_CHANGED = 4
"""Single effects that are tried so, those that explain most first."""


class Search:
    """Weighs sets of effects until no neighbour of the most probable ones is left to try.

    Parameters
    ----------
    fitter : Fitter
    trials : Trials
    hypotheses : Hypotheses
        Holds the single effects; those with several are added.
    """

    def __init__(self, fitter: Fitter, trials: Trials, hypotheses: Hypotheses) -> None:
        self._fitter, self._trials, self._hypotheses = fitter, trials, hypotheses
        self._tried: set[frozenset[str]] = {frozenset()}
        self._tried_anew: set[frozenset[str]] = set()
        self._tried_in_pairs: set[frozenset[str]] = set()
        self._tried_exchanged: set[frozenset[str]] = set()

    def run(self) -> None:
        """Look for sets until the most probable one stays so where the recording is likeliest.

        What stands first by its fit may not do so once near sets are settled; then its neighbours are tried, too.
        """
        best: tuple[str, ...] | None = None
        while best != self._hypotheses.weighed[0].effects:
            self._look()
            best = self._hypotheses.weighed[0].effects
            self._hypotheses.settle()

    def _look(self) -> None:
        """Try one more effect beside the most probable set, and of each size beside the likeliest and the closest.

        What is far off is poor under each set, however far: the likeliest part of a set may be none of the right one.
        The loss still says which part comes closest.
        """
        while True:
            self._around_the_best()
            of_size = self._of_sizes()
            likely = [fit for its in of_size for fit in its[:MOST_EXTENDED]]
            closest = [min(its, key=self._fitter.cost) for its in of_size]
            if not (
                self._extended([*likely, *closest]) or self._extended_anew() or self._paired() or self._exchanged()
            ):
                return

    def _of_sizes(self) -> list[list[Fit]]:
        """Sets that may be the answer and can be extended, by their number of effects, the likeliest first."""
        fits = [one.fit for one in self._hypotheses.possible]
        of_size = ([fit for fit in fits if len(fit.names) == size] for size in range(1, MOST_EFFECTS))
        return [its for its in of_size if its]

    def _around_the_best(self) -> None:
        """Try one more effect beside the most probable set, and beside it without each of its effects.

        Greedy choices are taken back: each effect of a set makes room for every other, the rest kept. A set may have
        a companion that is too small to be told.
        """
        while True:
            best = self._hypotheses.weighed[0].fit
            members = range(len(best.names)) if len(best.names) > 1 else ()
            fewer = [self._fitter.without(best, member) for member in members]
            if not self._extended([best, *(base for base in fewer if base is not None)]):
                return

    def _extended(self, fits: Sequence[Fit]) -> bool:
        """Weigh some fits with one more effect, and say whether there was one of which that was not known."""
        bases = _untried((fit for fit in fits if len(fit.names) < MOST_EFFECTS), self._tried)
        if bases:
            self._hypotheses.add(self._trials.with_one_more(bases, self._hypotheses.beside(bases)))
        return bool(bases)

    def _extended_anew(self) -> bool:
        """Where it takes many effects, try one beside the likeliest of fewer by what it does there; say as above."""
        most = len(self._hypotheses.weighed[0].fit.names)
        if most < MANY_EFFECTS:
            return False
        likeliest = (its[0] for its in self._of_sizes())
        bases = _untried((fit for fit in likeliest if len(fit.names) <= most), self._tried_anew)
        if bases:
            self._hypotheses.add(self._trials.anew(bases, self._hypotheses.beside(bases), self._hypotheses.known))
        return bool(bases)

    def _paired(self) -> bool:
        """Weigh the most promising pairs of which no part was near, and say whether there were any."""
        singles = [one.fit for one in self._hypotheses.possible if len(one.effects) == 1]
        bases = _untried((fit for fit in singles if frozenset(fit.names) not in self._tried), self._tried_in_pairs)
        besides = self._hypotheses.beside(bases)
        pairs = self._trials.of_pairs(bases, besides, self._hypotheses.known)
        self._hypotheses.add(pairs)
        return bool(pairs)

    def _exchanged(self) -> bool:
        """Weigh the best set with an effect exchanged for one that does the like, and say whether there was such.

        It was extended without that effect, but the others may have stood where nothing shows what comes beside them.
        """
        found: list[Fit] = []
        for best in _untried([self._hypotheses.weighed[0].fit], self._tried_exchanged):
            (beside,) = self._hypotheses.beside([best])
            found += self._trials.exchanged(best, beside.weights, self._hypotheses.known)
        self._hypotheses.add(found)
        return bool(found)


def _untried(fits: Iterable[Fit], tried: set[frozenset[str]]) -> list[Fit]:
    """Fits whose names were not tried, each once; they are from now on."""
    of_names = {frozenset(fit.names): fit for fit in fits}
    found = [fit for names, fit in of_names.items() if names not in tried]
    tried.update(of_names)
    return found


def in_order(
    fitter: Fitter, fit: Fit, ends: Floats, told: Sequence[str], posterior: Sequence[SetProbability]
) -> tuple[Fit, Floats]:
    """The fit with its effects in order, and the ends of its intervals.

    Those that are told come before the others, and in each part those that more likely act. Of those that are as
    likely to the hundredth the one comes first without which most is left.
    """
    left = [fitter.cost(fitter.without(fit, member)) for member in range(len(fit.names))]
    likely = [round(sum(one.probability for one in posterior if name in one.effects), 2) for name in fit.names]
    is_beside = [name not in told for name in fit.names]
    order = sorted(range(len(left)), key=lambda member: (is_beside[member], -likely[member], -left[member]))
    parts = fit.split(ends)
    ordered = Fit(
        candidates=tuple(fit.candidates[k] for k in order),
        points=tuple(fit.points[k] for k in order),
        residuals=fit.residuals,
    )
    return ordered, np.concatenate([parts[k] for k in order])


def completed(fitter: Fitter, fit: Fit, everywhere: Iterable[Candidate]) -> Fit:
    """The fit with what each real station has, where that comes closer to cycles that were not fitted."""
    for candidate in everywhere:
        if candidate.name not in fit.names:
            started = min([fit, *fitter.along(candidate, candidate.start_grids({}), fit)], key=fitter.cost)
            whole = fit if started is fit else fitter.refine(started)
            fit = min(fit, whole, key=lambda one: float(np.sum(one.residuals[~fitter.rows] ** 2)))
    return fit


def changed(fitter: Fitter, fits: Sequence[Fit], each: Each) -> list[Fit]:
    """Fits once more, with a strength for each period of those effects that wear, grow or drift.

    Parameters
    ----------
    fitter : Fitter
    fits : sequence of Fit
    each : callable
        Fits them, perhaps side by side.

    Returns
    -------
    fits : list of Fit
        Those that have such an effect; none of a single period.
    """
    periods = fitter.periods
    if periods < 2:
        return []
    started = [begun for fit in fits if (begun := _begun(fitter, fit, periods)) is not None]
    return list(each(fitter.refine, started))


def _begun(fitter: Fitter, fit: Fit, periods: int) -> Fit | None:
    """The fit with the same strength in each period, where one may change."""
    may_change = [EFFECTS[one.name].may_change and one.periods == 1 for one in fit.candidates]
    if not any(may_change):
        return None
    candidates = tuple(
        one.changing(periods) if changes else one for one, changes in zip(fit.candidates, may_change, strict=True)
    )
    points = []
    for one, point, changes in zip(fit.candidates, fit.points, may_change, strict=True):
        counts = [periods if changes and free.neutral is not None else 1 for free in one.free]
        points.append(np.repeat(point, counts))
    return fitter.at(candidates, points)
