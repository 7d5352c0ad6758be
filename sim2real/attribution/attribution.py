"""Which effects of the library explain the gap: fitted on half of the cycles, ranked on the other half."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.candidates import TRIALS, Candidate
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.initial_guess import hints_of
from wetwell.sim2real.attribution.intervals import intervals_of
from wetwell.sim2real.attribution.significance import is_sure
from wetwell.sim2real.recording.regimes import MULTI_PUMP, REGIMES
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import SIGNALS, Bins
from wetwell.sim2real.residuals.residuals import Misfit, soft
from wetwell.sim2real.residuals.structure import phase

Each = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""Applies a function to items, in order, as `map` does: perhaps side by side."""

VISIBLE = 0.2
"""Gain in mean square of a group of bins, in units of noise, under which a gap is not worth a name."""
CLEAR = 0.5
"""The same for a further effect: small gains are what the form of the first one leaves."""
NARROW = 1.0
"""The same in one span of time after switching, for the first effect: a gap of a second or two at each start."""
LEAST_GAIN = 200.0
"""Drop of the sum of squares that a right model may make by chance."""
PRICE = 0.006
"""Share of the best gain that each free parameter costs: of two equal explanations the simpler is taken."""
EXCUSED_S = 2
"""Transients in ramps that a right model may be late or early by, and more, when it comes to what is left."""
KEPT = 1.0 / 3.0
"""Share of its gap that a signal may keep under the accepted effects."""
WORTH = 1.5
"""Mean square of a cell beyond noise, in units of it, for which a further effect is looked for in any case."""
MIN_BINS = 12
QUIET = 0.3
"""Mean square of a signal beyond noise, in units of it, under which the signal shows no gap."""
UNDONE_SHARE = 0.25
"""Share of the whole gap that one effect may make in quiet signals for another to undo."""
MOST_EFFECTS = 3
PROBES = (0.02,)
"""Strengths, as shares of the range, by which a further effect is judged before it is fitted."""
LIKELY = 8
"""Further effects that are fitted, the most promising first."""
JOIN_SHARE = 0.06
"""Least gain of a further effect, as a share of what the first explains, which its form may leave."""
LEAST_COUNT = 10
"""Bins without which a group says nothing."""
CHANCE = 4.0
"""Standard deviations of a sum of squares that noise does not reach."""
OWN_SHARE = 0.002
"""Least gain of a further effect beyond `JOIN_SHARE` of each span, as a share of what the first explains in all."""
CLASS_SHARE = 0.02
"""Explanations within this share of the best gain are equivalent."""
NOISY_SHARE = 0.06
"""The same where the cycles do not agree which is better."""
MOST_EQUIVALENT = 2
"""Effects beside the one found: a larger class tells nobody anything."""
BETTER = 0.01
"""Share of what a member gains by which another has to gain more to take its place."""
PROMISING = 0.02
"""Share of the best gain before refinement under which a candidate is not refined."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranked:
    """A fitted candidate and its gain on the cycles it was not fitted on: in all, and priced for its parameters."""

    fit: Fit
    gain: float
    score: float
    by_cycle: Floats

    @property
    def is_sure(self) -> bool:
        """Whether the gain is beyond chance."""
        return is_sure(self.by_cycle)


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribution:
    """Outcome: the plain residuals, the accepted fit (None: no effect), single candidates by score, held-out rows.

    `left` are the residuals under the accepted effects; where values of each second cannot show one of these, or
    none is accepted, with short transients in ramps excused. In the order of the accepted candidates: `equivalent`
    are the effects that explain as much in the place of each, `ends` those of the 95 % interval of each of their
    places.
    """

    plain: Floats
    accepted: Fit | None
    left: Floats
    equivalent: tuple[tuple[str, ...], ...]
    ends: Floats
    singles: tuple[Ranked, ...]
    fitted: Flags
    held: Flags


def halves(bins: Bins, pumps: int) -> tuple[Flags, Flags]:
    """Bins to fit and to judge: cycles alternate, as many at a time as there are pumps, so that each pump is in both.

    Cycles with several pumps at once are few: they alternate one by one.
    """
    cycles, of_bin = np.unique(bins.cycle, return_inverse=True)
    is_multi = np.bincount(of_bin, bins.regime == MULTI_PUMP) > 0.0
    first = (cycles // pumps) % 2 == 0
    first[is_multi] = np.arange(int(is_multi.sum())) % 2 == 0
    return first[of_bin], ~first[of_bin]


class Attributor:
    """Searches the library for what explains a recording.

    Parameters
    ----------
    replay, misfit : Replay, Misfit
    candidates : sequence of Candidate
    progress : callable
        Gets the share of the work that is done, 0 to 1.
    each : callable
        Tries candidates, perhaps side by side: the replay holds no lock.
    """

    def __init__(
        self,
        replay: Replay,
        misfit: Misfit,
        candidates: Sequence[Candidate],
        progress: Callable[[float], None] = lambda _: None,
        each: Each = map,
    ) -> None:
        self._each = each
        self._misfit = misfit
        self._candidates = tuple(candidates)
        self._progress = progress
        prediction = replay.run()
        self._plant = prediction.plant
        self.plain = soft(misfit.residuals(prediction))
        self.fitted, self.held = halves(misfit.bins, replay.traces.pumps)
        bins = misfit.bins
        key = (bins.signal * len(REGIMES) + bins.regime) * 32 + phase(bins)
        self._span = np.unique(key[self.held], return_inverse=True)[1]
        self._fitter = Fitter(replay, misfit, self.fitted)
        self._rivals: dict[frozenset[str], list[Ranked]] = {}
        self._hints = {candidate: hints_of(candidate, replay, misfit, self.plain) for candidate in candidates}

    def search(self) -> Attribution:
        """Single effects first, then further ones while they help, each member swapped for all others."""
        singles = self._singles()
        best = singles[0] if singles else None
        accepted: Fit | None = None
        equivalent: tuple[tuple[str, ...], ...] = ()
        if best is not None and self._is_real(self.plain, best):
            final = self._ordered(self._reduced(self._extend(best, singles), best))
            accepted, equivalent = final.fit, self._equivalent(final, singles)
        self._progress(1.0)
        return Attribution(
            plain=self.plain,
            accepted=accepted,
            left=self._left(accepted),
            equivalent=equivalent,
            ends=np.zeros((0, 2)) if accepted is None else intervals_of(self._fitter, accepted, self._misfit.bins),
            singles=tuple(singles),
            fitted=self.fitted,
            held=self.held,
        )

    def _singles(self) -> list[Ranked]:
        before = self._fitter.cost(self.plain)
        firsts = []
        tried = self._each(
            lambda candidate: self._fitter.first(candidate, self._ladders(candidate)), self._candidates
        )
        for k, fit in enumerate(tried):
            if fit is not None:
                firsts.append(fit)
            self._progress(0.3 * (k + 1) / len(self._candidates))
        most = max((before - self._fitter.cost(fit.residuals) for fit in firsts), default=0.0)
        ranked = []

        def refined(fit: Fit) -> Fit:
            gain = before - self._fitter.cost(fit.residuals)
            return self._fitter.refine(fit) if gain > PROMISING * most and gain > 0.0 else fit

        for k, fit in enumerate(self._each(refined, firsts)):
            ranked.append(self._rank(self.plain, fit))
            self._progress(0.3 + 0.4 * (k + 1) / len(firsts))
        return _priced(ranked, _plainest)

    def _ladders(self, candidate: Candidate, trials: Sequence[float] = TRIALS) -> list[list[Floats]]:
        """Places to begin at, each ladder once: hints that leave the strength open have the same ones."""
        ladders = [ladder for hints in self._hints[candidate] for ladder in candidate.ladders(hints, trials)]
        return list({b"".join(place.tobytes() for place in ladder): ladder for ladder in ladders}.values())

    def _extend(self, best: Ranked, singles: Sequence[Ranked]) -> Ranked:
        current = best
        floor = self._misfit.bins.floor
        for _ in range(MOST_EFFECTS - 1):
            left = self._left(current.fit)
            is_open = self._open(left)
            is_little = float((left**2 - floor)[self.held].sum()) < JOIN_SHARE * best.gain
            if is_little and not is_open and not self._is_own(current.fit.residuals**2 - floor, best):
                break  # no further effect could gain enough
            others = self._joined(current, _names(singles))
            if not others:
                break
            own = [one for one in others[1:] if self._adds(one.fit, current.fit, best)]
            tried = next(
                (one for one in (others[0], *own[:1]) if self._is_further(one, current, best, is_open)), None
            )
            if tried is None:
                break
            current = self._swapped(tried, singles)
        return current

    def _is_further(self, tried: Ranked, current: Ranked, first: Ranked, is_open: set[int]) -> bool:
        """Whether the last of the effects that are tried adds enough to the current ones, and surely."""
        extra = self._rank(current.fit.residuals, tried.fit)
        is_enough = extra.gain >= JOIN_SHARE * first.gain or self._open(self._left(tried.fit)) < is_open
        is_enough = is_enough or self._adds(tried.fit, current.fit, first)
        return is_enough and self._is_real(current.fit.residuals, extra, CLEAR, np.inf)

    def _left(self, fit: Fit | None) -> Floats:
        """Residuals under a fit; with short transients in ramps excused unless all of it can be seen."""
        effects = () if fit is None else fit.effects
        is_seen = bool(effects) and all(effect.is_seen(self._plant) for effect in effects)
        return self._fitter.left(effects, 0 if is_seen else EXCUSED_S)

    def _adds(self, tried: Fit, before: Fit, first: Ranked) -> bool:
        """Whether the last effect of a fit can be seen, and explains what the form of the first may not have left."""
        gains = before.residuals**2 - tried.residuals**2
        return tried.effects[-1].is_seen(self._plant) and self._is_own(gains, first)

    def _is_own(self, gains: Floats, first: Ranked) -> bool:
        """Whether there is more in some spans than the form of the first effect may have left there, or chance."""
        counts = self._by_span(np.ones(self._misfit.bins.size))
        left_by_form = JOIN_SHARE * np.maximum(self._by_span(self.plain**2 - first.fit.residuals**2), 0.0)
        own = self._by_span(gains) - left_by_form
        return float(own[own > CHANCE * np.sqrt(2.0 * counts)].sum()) > max(OWN_SHARE * first.gain, LEAST_GAIN)

    def _by_span(self, values: Floats) -> Floats:
        """Sums over the held bins of each signal and regime, and span of time since that began."""
        return np.bincount(self._span, values[self.held]).astype(np.float64)

    def _by_cell(self, values: Floats) -> Floats:
        """Sums over the held bins of each signal and regime."""
        bins = self._misfit.bins
        cell = bins.signal[self.held] * len(REGIMES) + bins.regime[self.held]
        return np.bincount(cell, values[self.held], len(SIGNALS) * len(REGIMES)).astype(np.float64)

    def _open(self, left: Floats) -> set[int]:
        """Signals that keep more than a third of their gap, and a gap that is worth a name."""
        bins = self._misfit.bins
        floor, signal = bins.floor[self.held], bins.signal[self.held]
        excess = left[self.held] ** 2 - floor
        counts = self._by_cell(np.ones(bins.size))
        means = self._by_cell(left**2 - bins.floor) / np.maximum(counts, 1.0)
        is_worth = np.any(((counts >= MIN_BINS) & (means > WORTH)).reshape(len(SIGNALS), -1), axis=1)
        now = np.bincount(signal, excess, len(SIGNALS))
        was = np.bincount(signal, self.plain[self.held] ** 2 - floor, len(SIGNALS))
        return set(np.flatnonzero(is_worth & (now > KEPT * was)).tolist())

    def _reduced(self, current: Ranked, first: Ranked) -> Ranked:
        """Without the members that the others can stand in for."""
        count = len(current.fit.candidates)
        for place in range(count if count > 1 else 0):
            start = self._but(current.fit, place)
            if start is None:
                continue
            fewer = self._rank(self.plain, self._fitter.refine(start))
            is_open = self._open(self._left(fewer.fit)) > self._open(self._left(current.fit))
            is_own = self._is_own(fewer.fit.residuals**2 - current.fit.residuals**2, first)
            if fewer.gain > (1.0 - JOIN_SHARE) * current.gain and not is_open and not is_own:
                return self._reduced(fewer, first)
        return current

    def _joined(self, current: Ranked, candidates: Sequence[Candidate]) -> list[Ranked]:
        """Fits of the current effects with one more, best first."""
        others = {c.component for c in current.fit.candidates} if len(current.fit.names) > 1 else set()
        free = [c for c in candidates if c.name not in current.fit.names and c.component not in others]
        promises = list(self._each(lambda candidate: self._promise(candidate, current.fit), free))
        likely = [free[k] for k in np.argsort(-np.array(promises), kind="stable")[:LIKELY]]
        tried = self._each(
            lambda candidate: self._fitter.first(candidate, self._ladders(candidate), others=current.fit), likely
        )
        firsts = sorted((fit for fit in tried if fit is not None), key=lambda fit: self._fitter.cost(fit.residuals))
        refined = self._each(self._fitter.refine, firsts[:4])
        ranked = _priced([self._rank(self.plain, fit) for fit in refined], _plainest, self._gain(current.fit))
        while ranked and self._is_contrived(ranked[0].fit):
            del ranked[0]
        return ranked

    def _is_contrived(self, fit: Fit) -> bool:
        """Whether an effect makes a gap in signals that show none, which the others undo."""
        signal = self._misfit.bins.signal[self.held]

        def by_signal(residuals: Floats) -> Floats:
            excess = (residuals**2 - self._misfit.bins.floor)[self.held]
            return np.bincount(signal, excess, len(SIGNALS)).astype(np.float64)

        plain = by_signal(self.plain)
        is_quiet = plain < QUIET * np.bincount(signal, minlength=len(SIGNALS))
        for place in range(len(fit.names)):
            fewer = self._but(fit, place)
            if fewer is None:
                continue
            undone = (by_signal(fewer.residuals) - plain)[is_quiet]
            if float(np.maximum(undone, 0.0).sum()) > UNDONE_SHARE * float(np.maximum(plain, 0.0).sum()):
                return True
        return False

    def _ordered(self, final: Ranked) -> Ranked:
        """The same with the effect first without which most is lost."""
        fit = final.fit
        left = [self._gain(self._but(fit, place)) for place in range(len(fit.names))]
        order = sorted(range(len(fit.names)), key=lambda k: left[k])
        ordered = Fit(
            candidates=tuple(fit.candidates[k] for k in order),
            places=tuple(fit.places[k] for k in order),
            residuals=fit.residuals,
        )
        return Ranked(fit=ordered, gain=final.gain, score=final.score, by_cycle=final.by_cycle)

    def _equivalent(self, final: Ranked, singles: Sequence[Ranked]) -> tuple[tuple[str, ...], ...]:
        """For each effect of the final fit those that explain about as much in its place."""
        names = final.fit.names
        found = []
        for place, name in enumerate(names):
            kept = names[:place] + names[place + 1 :]
            rivals = self._rivals.get(frozenset(kept), ()) if kept else singles
            least = final.gain - self._gain(self._but(final.fit, place))
            own = [rival.fit.names[-1] for rival in rivals if _is_equal(final, rival, least)]
            found.append(tuple(one for one in own if one != name)[:MOST_EQUIVALENT])
        return tuple(found)

    def _but(self, fit: Fit, place: int) -> Fit | None:
        """A fit without one of its effects, the others where they stand."""
        kept = [k for k in range(len(fit.candidates)) if k != place]
        candidates, places = tuple(fit.candidates[k] for k in kept), tuple(fit.places[k] for k in kept)
        residuals = self._fitter.residuals(candidates, places)
        return None if residuals is None else Fit(candidates=candidates, places=places, residuals=residuals)

    def _gain(self, fit: Fit | None) -> float:
        return 0.0 if fit is None else max(float(np.sum((self.plain**2 - fit.residuals**2)[self.held])), 0.0)

    def _promise(self, candidate: Candidate, current: Fit) -> float:
        """Drop of the sum of squares that one trial of each strength promises, as if all were linear in it."""
        before = current.residuals[self.fitted]
        most = 0.0
        for (start,) in self._ladders(candidate, PROBES):
            residuals = self._fitter.residuals((*current.candidates, candidate), (*current.places, start))
            if residuals is not None:
                change = residuals[self.fitted] - before
                along = max(-float(change @ before), 0.0)
                most = max(most, along**2 / max(float(change @ change), 1e-12))
        return most

    def _swapped(self, current: Ranked, singles: Sequence[Ranked]) -> Ranked:
        """Each member in turn against every other candidate, the rest kept: greedy choices are taken back."""
        for place in range(len(current.fit.candidates)):
            base = self._but(current.fit, place)
            if base is None:
                continue
            others = self._joined(Ranked(fit=base, gain=0.0, score=0.0, by_cycle=np.zeros(1)), _names(singles))
            self._rivals[frozenset(base.names)] = others
            known = self._gain(base)
            if others and others[0].score - known > (current.score - known) * (1.0 + BETTER):
                current = others[0]
        return current

    def _rank(self, before: Floats, fit: Fit) -> Ranked:
        gains = (before**2 - fit.residuals**2)[self.held]
        cycles = np.unique(self._misfit.bins.cycle[self.held], return_inverse=True)[1]
        by_cycle = np.bincount(cycles, gains).astype(np.float64)
        gain = float(gains.sum())
        return Ranked(fit=fit, gain=gain, score=gain, by_cycle=by_cycle)

    def _is_real(self, before: Floats, ranked: Ranked, visible: float = VISIBLE, narrow: float = NARROW) -> bool:
        """Whether a gain is beyond chance, and beyond what is worth a name, in some group of bins."""
        if not ranked.is_sure or ranked.gain < LEAST_GAIN:
            return False
        gains, ones = before**2 - ranked.fit.residuals**2, np.ones(self._misfit.bins.size)
        return any(
            float(np.max((sums(gains) / np.maximum(sums(ones), 1.0))[sums(ones) >= LEAST_COUNT], initial=0.0)) > least
            for sums, least in ((self._by_cell, visible), (self._by_span, narrow))
        )


def _is_equal(best: Ranked, rival: Ranked, share_of: float) -> bool:
    """Whether a rival explains as much but for a small share, or for a larger one that may be chance."""
    behind = best.by_cycle - rival.by_cycle
    lost = float(behind.sum())
    return lost <= CLASS_SHARE * share_of or (lost <= NOISY_SHARE * share_of and not is_sure(behind))


def _names(singles: Sequence[Ranked]) -> list[Candidate]:
    return [single.fit.candidates[0] for single in singles]


def _plainest(fit: Fit) -> int:
    return fit.free


def _priced(ranked: list[Ranked], count: Callable[[Fit], int], known: float = 0.0) -> list[Ranked]:
    """Ranked by gain less the price of the free parameters; the best variant of each combination of names.

    The price is a share of what the best one gains over what is `known`.
    """
    most = max((r.gain - known for r in ranked), default=0.0)
    priced = [
        Ranked(fit=r.fit, gain=r.gain, score=r.gain - PRICE * most * count(r.fit), by_cycle=r.by_cycle)
        for r in ranked
    ]
    best: dict[tuple[str, ...], Ranked] = {}
    for r in sorted(priced, key=lambda r: -r.score):
        best.setdefault(tuple(sorted(r.fit.names)), r)
    return list(best.values())
