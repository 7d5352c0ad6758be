"""The effects of the library, tried one by one: alone, and beside others."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.promise import Alone, Beside, Promise
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.evidence import Weights
from wetwell.sim2real.residuals.asinh_loss import residuals_of

Each = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""Applies a function to items, in order, as `map` does: perhaps side by side."""

MOST_TRIED = 8
"""Further effects that are tried, the most promising first."""
MOST_STARTS = 3
"""Starts of each that are replayed: what it does is not linear in how fast it grows, or where its edge is."""
MOST_REFINED = 4
LEAST_PROMISED = 10.0
"""Drop of the weighed squares under which a further effect is not tried: it could not pay for its place."""
MOST_KEPT = 4.0
"""Times what it promises that an effect may be worth: with less than a set lacks, it is not tried beside that."""
PART_OF_MOST = 0.5
"""Part of what the most promising effect promises with which another one is tried, where that is."""
MOST_PAIRED = 2
"""Pairs of effects that are far off alone which are tried: each costs as much as a single effect does."""
LIKE = 0.5
"""Share of what an effect does alone that another one has to do alone, to be tried in its place."""
PROMISING = 0.02
"""Share of the best gain before refinement under which a candidate is not refined."""


class Trials:
    """Fits candidates to the training cycles.

    Parameters
    ----------
    fitter : Fitter
    cells : Cells
        Of the residuals that it fits.
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
        cells: Cells,
        guesses: Mapping[Candidate, Sequence[Mapping[str, float]]],
        progress: Callable[[float], None],
        each: Each,
    ) -> None:
        self._fitter = fitter
        self._cells = cells
        self._guesses = guesses
        self._progress = progress
        self._each = each
        self._in_layout: dict[tuple[Candidate, ...], Mapping[Candidate, Alone]] = {}

    @cached_property
    def _alone(self) -> dict[Candidate, tuple[Alone, Fit]]:
        """Of each candidate what it does alone, and its best fit without refinement."""
        found = {}
        tried = self._each(self._tried, self._guesses)
        for k, (candidate, fits) in enumerate(zip(self._guesses, tried, strict=True)):
            if fits:
                found[candidate] = self._doing(self._fitter.plain, fits), min(fits, key=self._fitter.cost)
            self._progress(0.3 * (k + 1) / len(self._guesses))
        return found

    def _tried(self, candidate: Candidate, beside: Fit | None = None, most: int | None = None) -> list[Fit]:
        """A candidate at its starts, at most so many of each grid."""
        return self._fitter.along(candidate, [grid[:most] for grid in self._start_grids(candidate)], beside)

    def _done_beside(self, base: Fit, others: Sequence[Candidate], most: int | None = None) -> dict[Candidate, Alone]:
        """What some candidates do beside a fit, as it was replayed."""
        tried = self._each(lambda one: self._tried(one, base, most), others)
        return {one: self._doing(base, fits) for one, fits in zip(others, tried, strict=True) if fits}

    def _alones(self, base: Fit) -> Mapping[Candidate, Alone]:
        """What each candidate does alone; where the base has another layout of the station, what it does in that.

        So where telemetry holds or rounds a channel: what moves within that shows nothing there.
        """
        layout = tuple(sorted((one for one in base.candidates if one.is_layout or one.is_pattern), key=str))
        if not layout:
            return {one: alone for one, (alone, _) in self._alone.items()}
        if layout not in self._in_layout:
            station = self._fitter.only(base, [one.name for one in layout]) or self._fitter.plain
            self._in_layout[layout] = self._done_beside(station, [one for one in self._guesses if one not in layout])
        return self._in_layout[layout]

    def _means(self, fit: Fit) -> Floats:
        """(cells,) residuals themselves."""
        return self._cells.means(residuals_of(fit.residuals))

    def singles(self) -> list[Fit]:
        """Single effects, each with the pump or channel that fits best; the best effect first."""
        fitter, before = self._fitter, self._fitter.cost(self._fitter.plain)
        firsts = [fit for _, fit in self._alone.values()]
        firsts.sort(key=lambda fit: -fit.position.size)  # the longest first, so that all cores end together
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

    def with_one_more(self, bases: Sequence[Fit], besides: Sequence[Beside]) -> list[Fit]:
        """Each of some fits with one more effect, the most promising ones, each as the pump or channel it fits.

        Parameters
        ----------
        bases : sequence of Fit
        besides : sequence of Beside
            The same, as what the others come beside.
        """
        return self._one_more(
            [(base, beside, self._alones(base)) for base, beside in zip(bases, besides, strict=True)]
        )

    def anew(self, bases: Sequence[Fit], besides: Sequence[Beside], known: Collection[frozenset[str]]) -> list[Fit]:
        """The same by what each effect does beside a fit, replayed there, where such a set is not known yet.

        What it does alone may be something else: a leak keeps a wet well from running dry, as an inflow does already.
        """
        found = []
        for base, beside in zip(bases, besides, strict=True):
            names = frozenset(base.names)
            others = [one for one in self._guesses if one.name not in names and names | {one.name} not in known]
            weakest = self._done_beside(base, [one for one in others if not one.is_pattern], most=1)
            found.append((base, beside, weakest))
        return self._one_more(found)

    def of_pairs(
        self, bases: Sequence[Fit], besides: Sequence[Beside], known: Collection[frozenset[str]]
    ) -> list[Fit]:
        """The most promising pairs that are not known yet, whichever of some single effects they begin with.

        Two that undo each other in a signal may each be far off alone: wear, and a head sensor that reads high.
        """
        found = [
            (2.0 * beside.lacks - promise.gain, base, beside, alone, promise)
            for base, beside in zip(bases, besides, strict=True)
            for alone, promise in self._pairs(base, beside, known)
        ]
        best: dict[frozenset[str], tuple[float, Fit, Beside, Alone, Promise]] = {}
        for one in sorted(found, key=lambda one: one[0]):
            best.setdefault(frozenset({*one[1].names, one[3].candidate.name}), one)
        firsts = [
            (base, beside, alone, fit, promise)
            for _, base, beside, alone, promise in list(best.values())[:MOST_PAIRED]
            if (fit := self._at(base, promise)) is not None
        ]
        return list(self._each(lambda one: self._refined(*one), firsts))

    def exchanged(self, best: Fit, weights: Weights, known: Collection[frozenset[str]]) -> list[Fit]:
        """A set with one effect exchanged for another that does the like alone, where such a set is not known yet.

        Parameters
        ----------
        best : Fit
        weights : Weights
            Of the cells by what it leaves.
        known : collection of frozenset of str
            Sets that were weighed.
        """
        alones, names = self._alones(best), frozenset(best.names)
        found = [
            (like, member, other)
            for member, candidate in enumerate(best.candidates)
            for other, alone in alones.items()
            if candidate in alones
            and other.name not in names
            and names - {candidate.name} | {other.name} not in known
            and (like := alones[candidate].like(alone, weights)) > LIKE
        ]
        of_set: dict[tuple[int, str], tuple[int, Candidate]] = {}
        for _, member, other in sorted(found, key=lambda one: -one[0]):
            of_set.setdefault((member, other.name), (member, other))

        def refined(one: tuple[int, Candidate]) -> Fit | None:
            base = self._fitter.without(best, one[0])
            starts = [] if base is None else self._tried(one[1], base)
            return self._fitter.refine(min(starts, key=self._fitter.cost)) if starts else None

        return [fit for fit in self._each(refined, list(of_set.values())[:MOST_PAIRED]) if fit is not None]

    def _pairs(self, base: Fit, beside: Beside, known: Collection[frozenset[str]]) -> list[tuple[Alone, Promise]]:
        """What may come beside an effect in a pair that is not known and could be as likely as the best set."""
        names = frozenset(base.names)
        alones = [
            alone
            for candidate, alone in self._alones(base).items()
            if candidate.name not in names and names | {candidate.name} not in known
        ]
        least = max(LEAST_PROMISED, 2.0 * beside.lacks / MOST_KEPT)
        promised = zip(alones, beside.promises(alones), strict=True)
        return [(alone, promise) for alone, (promise, *_) in promised if promise.gain > least]

    def _one_more(self, bases: Sequence[tuple[Fit, Beside, Mapping[Candidate, Alone]]]) -> list[Fit]:
        promises = self._each(lambda one: self._promising(*one), bases)
        likely = [(base, one) for (base, *_), its in zip(bases, promises, strict=True) for one in its]
        tried = list(self._each(lambda pair: self._at(*pair), likely))
        firsts = []
        for base, beside, alones in bases:
            own = [fit for (its, _), fit in zip(likely, tried, strict=True) if its is base and fit is not None]
            promised = beside.promises([self._doing(base, [fit]) for fit in own])
            best: dict[str, tuple[Fit, Promise]] = {}
            for k in sorted(range(len(own)), key=lambda k: -promised[k][0].gain):
                best.setdefault(own[k].candidates[-1].name, (own[k], promised[k][0]))
            likeliest = list(best.values())[:MOST_REFINED]
            firsts += [(base, beside, alones[fit.candidates[-1]], fit, promise) for fit, promise in likeliest]
        firsts.sort(key=lambda one: -one[3].position.size)  # the longest first, so that all cores end together
        return list(self._each(lambda one: self._refined(*one), firsts))

    def _doing(self, base: Fit, fits: Sequence[Fit]) -> Alone:
        """What the last effect of some fits does beside a base, as it was replayed."""
        before = self._means(base)
        return Alone(
            candidate=fits[0].candidates[-1],
            points=tuple(fit.points[-1] for fit in fits),
            changes=np.array([self._means(fit) - before for fit in fits]),
        )

    def _promising(self, base: Fit, beside: Beside, alones: Mapping[Candidate, Alone]) -> list[Promise]:
        """Starts of the effects that may come beside a fit: patterns that the values show, and the most promising.

        What steps do to a level that is wrong says nothing of what they do to one that is right.
        """
        free = [alone for candidate, alone in alones.items() if candidate.name not in base.names]
        promised = list(chain.from_iterable(beside.promises(free)))
        most = max((one.gain for one in promised), default=0.0)
        wanted = 2.0 * beside.lacks / MOST_KEPT
        least = max(LEAST_PROMISED, min(wanted, PART_OF_MOST * most) if most > wanted else wanted)
        of_name: dict[str, list[Promise]] = {}
        for one in promised:
            if one.gain > least or one.candidate.is_pattern:
                of_name.setdefault(one.candidate.name, []).append(one)
        starts = [sorted(its, key=lambda one: -one.gain)[:MOST_STARTS] for its in of_name.values()]
        starts.sort(key=lambda its: (not its[0].candidate.is_pattern, -its[0].gain))
        return list(chain.from_iterable(starts[:MOST_TRIED]))

    def _at(self, current: Fit, promise: Promise) -> Fit | None:
        return self._fitter.at((*current.candidates, promise.candidate), (*current.points, promise.point))

    def _refined(self, current: Fit, beside: Beside, alone: Alone, fit: Fit, promise: Promise) -> Fit:
        """A fit with one more effect, refined: where it ends worse than without that, from another start.

        What it does as it was replayed says how strong it should be: a limit does little more until it is passed.
        The first start counts on what the others can reach, as if all were linear: a limit may promise much where a
        header would have to take back all that it explains. The other one is the best with the others as they stand.
        """
        fitter = self._fitter
        nearer = self._at(current, promise)
        refined = fitter.refine(fit if nearer is None else min(fit, nearer, key=fitter.cost))
        if fitter.cost(refined) <= fitter.cost(current):
            return refined
        ((stays, *_),) = beside.still.promises([alone])
        again = self._at(current, stays)
        found = [refined] if again is None else [refined, fitter.refine(again)]
        return min(found, key=fitter.cost)

    def _start_grids(self, candidate: Candidate) -> list[list[Floats]]:
        """Points to begin at, each grid once: guesses that leave the strength open have the same ones."""
        grids = [grid for guess in self._guesses[candidate] for grid in candidate.start_grids(guess)]
        return list({b"".join(point.tobytes() for point in grid): grid for grid in grids}.values())
