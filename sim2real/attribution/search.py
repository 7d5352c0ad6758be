"""The search for sets of effects: the best one with one more, and each of its members exchanged."""

from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.hypotheses import Hypotheses
from wetwell.sim2real.attribution.trials import Trials

MOST_EFFECTS = 4
"""Effects of a set: three, and the inertia that the water of each main has."""


def search(fitter: Fitter, trials: Trials, hypotheses: Hypotheses) -> None:
    """Weigh sets of effects until no neighbour of the most probable one is left to try.

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
        best = hypotheses.weighed[0].fit
        bases = [best] if len(best.names) < MOST_EFFECTS else []
        if len(best.names) > 1:
            bases += [base for k in range(len(best.names)) if (base := fitter.without(best, k)) is not None]
        bases = [base for base in bases if frozenset(base.names) not in tried]
        if not bases:
            return
        for base in bases:
            tried.add(frozenset(base.names))
            hypotheses.add(trials.with_one_more(base))


def in_order(fitter: Fitter, fit: Fit) -> Fit:
    """The fit with its effects in order, the one without which most is left first."""
    left = [fitter.cost(fitter.without(fit, member)) for member in range(len(fit.names))]
    order = sorted(range(len(fit.names)), key=lambda member: -left[member])
    return Fit(
        candidates=tuple(fit.candidates[k] for k in order),
        points=tuple(fit.points[k] for k in order),
        residuals=fit.residuals,
    )
