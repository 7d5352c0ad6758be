"""The search for sets of effects: the best one with one more, and each of its members exchanged."""

import numpy as np

from wetwell.sim2real.attribution.fit.fitting import Fit, Fitter
from wetwell.sim2real.attribution.hypotheses import Hypotheses, Hypothesis
from wetwell.sim2real.attribution.trials import Trials
from wetwell.sim2real.likelihood.posterior import CREDIBLE

MOST_EFFECTS = 4
"""Effects of a set: three, and the inertia that the water of each main has."""


def search(fitter: Fitter, trials: Trials, hypotheses: Hypotheses) -> None:
    """Weigh sets of effects until no neighbour of the most probable ones is left to try.

    Greedy choices are taken back: each effect of a set makes room for every other, the rest kept. A set may have a
    companion that is too small to be told.

    Parameters
    ----------
    fitter : Fitter
    trials : Trials
    hypotheses : Hypotheses
        Holds the single effects; those with several are added.
    """
    tried: set[frozenset[str]] = {frozenset()}
    while True:
        bases = [base for one in _probable(hypotheses) for base in _bases(fitter, one.fit)]
        bases = [base for base in bases if frozenset(base.names) not in tried]
        if not bases:
            return
        for base in bases:
            if frozenset(base.names) not in tried:
                tried.add(frozenset(base.names))
                hypotheses.add(trials.with_one_more(base))


def _probable(hypotheses: Hypotheses) -> list[Hypothesis]:
    """The set that weighs most, and the best other one without a companion if that is as probable."""
    best = hypotheses.weighed[0]
    other = next((one for one in hypotheses.possible if one is not best), best)
    is_as_good = other.evidence.log > best.evidence.log + np.log(1.0 - CREDIBLE)
    return [best, other] if is_as_good else [best]


def _bases(fitter: Fitter, fit: Fit) -> list[Fit]:
    """Sets that are extended: a set as it is, and without each of its effects."""
    bases = [fit] if len(fit.names) < MOST_EFFECTS else []
    if len(fit.names) > 1:
        bases += [base for k in range(len(fit.names)) if (base := fitter.without(fit, k)) is not None]
    return bases


def in_order(fitter: Fitter, fit: Fit) -> Fit:
    """The fit with its effects in order, the one without which most is left first."""
    left = [fitter.cost(fitter.without(fit, member)) for member in range(len(fit.names))]
    order = sorted(range(len(fit.names)), key=lambda member: -left[member])
    return Fit(
        candidates=tuple(fit.candidates[k] for k in order),
        points=tuple(fit.points[k] for k in order),
        residuals=fit.residuals,
    )
