"""The search for several effects: forward selection, exchange of members, backward elimination."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.gains import FURTHER_CELL_GAIN, JOIN_SHARE, Gains, RankedFit
from wetwell.sim2real.attribution.trials import Trials

MOST_EFFECTS = 3
MOST_EQUIVALENT = 2
"""Effects beside the one found: a larger class tells nobody anything."""
BETTER = 0.01
"""Share of what a member gains by which another has to gain more to take its place."""


class Search:
    """Begins with the best single effect, and goes on while further ones help.

    Parameters
    ----------
    fitter : Fitter
    gains : Gains
    trials : Trials
    singles : sequence of RankedFit
        Single effects, best first.
    """

    def __init__(self, fitter: Fitter, gains: Gains, trials: Trials, singles: Sequence[RankedFit]) -> None:
        self._fitter = fitter
        self._gains = gains
        self._trials = trials
        self._singles = singles
        self._first = singles[0]
        self._library = [single.fit.candidates[0] for single in singles]
        self._rivals: dict[frozenset[str], list[RankedFit]] = {}

    def accepted(self) -> RankedFit:
        """The effects that explain the gap, the one first without which most is lost."""
        return self._ordered(self._backward_eliminate(self._forward_select()))

    def equivalent(self, final: RankedFit) -> tuple[tuple[str, ...], ...]:
        """For each effect of the final fit those that explain about as much in its place."""
        names = final.fit.names
        found = []
        for member, name in enumerate(names):
            kept = names[:member] + names[member + 1 :]
            rivals = self._rivals.get(frozenset(kept), ()) if kept else self._singles
            gain = final.gain - self._gains.of(self._fitter.without(final.fit, member))
            equal = [rival.fit.names[-1] for rival in rivals if final.is_matched_by(rival, gain)]
            found.append(tuple(one for one in equal if one != name)[:MOST_EQUIVALENT])
        return tuple(found)

    def _forward_select(self) -> RankedFit:
        """Further effects, while one adds enough; after each, members are exchanged."""
        current = self._first
        for _ in range(MOST_EFFECTS - 1):
            left = self._fitter.left(current.fit)
            if not self._gains.is_worth_more(left, current.fit, self._first):
                break
            others = self._trials.with_one_more(current.fit, self._library)
            own = [one for one in others[1:] if self._adds(one.fit, current.fit)]
            is_open = self._gains.open_signals(left)
            further = next((one for one in (*others[:1], *own[:1]) if self._is_further(one, current, is_open)), None)
            if further is None:
                break
            current = self._exchange(further)
        return current

    def _is_further(self, tried: RankedFit, current: RankedFit, is_open: set[int]) -> bool:
        """Whether the last of the effects that are tried adds enough to the current ones, and surely."""
        before = current.fit.residuals
        extra = self._gains.ranked(tried.fit, before)
        is_enough = (
            extra.gain >= JOIN_SHARE * self._first.gain
            or self._gains.open_signals(self._fitter.left(tried.fit)) < is_open
            or self._adds(tried.fit, current.fit)
        )
        return is_enough and self._gains.is_real(extra, before, FURTHER_CELL_GAIN, np.inf)

    def _adds(self, tried: Fit, before: Fit) -> bool:
        """Whether the last effect of a fit can be seen, and explains what the form of the first may not have left."""
        gains = before.residuals**2 - tried.residuals**2
        return tried.effects[-1].is_seen(self._fitter.plant) and self._gains.is_own(gains, self._first)

    def _exchange(self, current: RankedFit) -> RankedFit:
        """Each member in turn against every other candidate, the rest kept: greedy choices are taken back."""
        for member in range(len(current.fit.candidates)):
            base = self._fitter.without(current.fit, member)
            if base is None:
                continue
            others = self._trials.with_one_more(base, self._library)
            self._rivals[frozenset(base.names)] = others
            known = self._gains.of(base)
            if others and others[0].score - known > (current.score - known) * (1.0 + BETTER):
                current = others[0]
        return current

    def _backward_eliminate(self, current: RankedFit) -> RankedFit:
        """Without the members that the others can stand in for."""
        count = len(current.fit.candidates)
        for member in range(count if count > 1 else 0):
            start = self._fitter.without(current.fit, member)
            if start is None:
                continue
            fewer = self._gains.ranked(self._fitter.refine(start))
            opened, before = (self._gains.open_signals(self._fitter.left(one.fit)) for one in (fewer, current))
            is_own = self._gains.is_own(fewer.fit.residuals**2 - current.fit.residuals**2, self._first)
            if fewer.gain > (1.0 - JOIN_SHARE) * current.gain and not opened > before and not is_own:
                return self._backward_eliminate(fewer)
        return current

    def _ordered(self, final: RankedFit) -> RankedFit:
        """Members by what is left without them, least first."""
        fit = final.fit
        left = [self._gains.of(self._fitter.without(fit, member)) for member in range(len(fit.names))]
        order = sorted(range(len(fit.names)), key=lambda member: left[member])
        ordered = Fit(
            candidates=tuple(fit.candidates[k] for k in order),
            points=tuple(fit.points[k] for k in order),
            residuals=fit.residuals,
        )
        return replace(final, fit=ordered)
