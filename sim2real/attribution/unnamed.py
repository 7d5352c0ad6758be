"""Something unknown that acts through the plant: a term of the model goes with what no effect has a name for."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import Candidate, FreeParameter
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.trials import Each
from wetwell.sim2real.correction.dictionary import dictionary
from wetwell.sim2real.correction.learning import covariates_of, of_each_target
from wetwell.sim2real.correction.selection import Proposal
from wetwell.sim2real.correction.workshop import Workshop, effect_of
from wetwell.sim2real.recording.regimes import IDLE
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import residuals_of
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects.effect import Component, Effect
from wetwell.simulator.effects.station.correction_part import MOST_SIZE
from wetwell.simulator.effects.station.learnt_correction import LEAST_OFFSET, place_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Unnamed(Candidate):
    """A correction of one term, of which the sizes are free.

    Attributes
    ----------
    proposal : Proposal
        Which term, and what its addends go with.
    """

    proposal: Proposal

    @property
    def component(self) -> Component:
        """Component in which its cause lies."""
        target = self.proposal.target
        return place_of(target.term, target.pump, [atom.place.covariate for atom in self.proposal.atoms])

    @property
    def log_prior(self) -> float:
        """Logarithm of the probability of its term and of what it goes with."""
        return self.proposal.log_prior

    def effect(self, point: Floats) -> Effect:
        """The correction with its sizes at a point."""
        sizes = np.array([free.value(float(one)) for free, one in zip(self.free, point, strict=True)])
        return effect_of(replace(self.proposal, sizes=sizes))


def unnamed(proposal: Proposal) -> tuple[Unnamed, Floats]:
    """A proposal as a candidate, and where its sizes stand in their ranges."""
    lows = [LEAST_OFFSET, *(-MOST_SIZE for _ in proposal.sizes[1:])]
    free = tuple(
        FreeParameter(name=f"size_{k}", unit="1", low=low, high=MOST_SIZE, start=0.0, neutral=0.0)
        for k, low in enumerate(lows)
    )
    point = np.array([one.normalised(float(size)) for one, size in zip(free, proposal.sizes, strict=True)])
    return Unnamed(name="learnt_correction", fixed=(), free=free, proposal=proposal), np.clip(point, 0.0, 1.0)


def unnamed_beside(
    replay: Replay, residuals: StationResiduals, fitter: Fitter, best: Fit, names: Collection[str], each: Each
) -> list[Fit]:
    """The best correction of each of the likeliest terms, alone and beside a set without each of its effects.

    A constant one that an effect has a name for is nothing unknown.

    Parameters
    ----------
    replay : Replay
    residuals : StationResiduals
    fitter : Fitter
    best : Fit
        The set.
    names : collection of str
        Of the effects that were tried.
    each : callable
        Replays, perhaps side by side.
    """
    shop, covariates = Workshop(replay, residuals), covariates_of(replay, residuals.bins)
    addends = shop.addends(dictionary(covariates, residuals.bins.regime != IDLE)[0])
    list(each(shop.sensitivity, [target for target in shop.targets if target.is_of_all]))
    without = [fitter.without(best, member) for member in range(len(best.names))]
    bases = {one.names: one for one in (fitter.plain, *without) if one is not None}

    def proposed(base: Fit) -> list[tuple[Fit, Unnamed, Floats]]:
        found = of_each_target(shop.proposals(addends, covariates, residuals_of(base.residuals)))
        likely = [next((one for one in its if not _is_named(one, names)), None) for its in found]
        return [(base, *unnamed(one)) for one in likely if one is not None and one.log > 0.0]

    tried = chain.from_iterable(each(proposed, bases.values()))
    found = each(lambda one: fitter.at((*one[0].candidates, one[1]), (*one[0].points, one[2])), tried)
    return [fit for fit in found if fit is not None]


def _is_named(proposal: Proposal, names: Collection[str]) -> bool:
    return not proposal.atoms and proposal.target.effect_of_a_constant in names
