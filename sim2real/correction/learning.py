"""Learn a correction: terms screened by their slopes, the best ones tried in the simulator, the most probable one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.correction.bin_covariates import Place, bin_covariates
from wetwell.sim2real.correction.dictionary import PERIOD_RATIO, Atom, dictionary
from wetwell.sim2real.correction.selection import Proposal
from wetwell.sim2real.correction.workshop import Tried, Workshop, effect_of
from wetwell.sim2real.recording.regimes import IDLE
from wetwell.sim2real.replay.replay import Replay, later
from wetwell.sim2real.residuals.asinh_loss import asinh_loss
from wetwell.sim2real.residuals.bins import Bins
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection


@dataclass(frozen=True, slots=True, kw_only=True)
class Learnt:
    """A correction with what speaks for it.

    Attributes
    ----------
    effect : LearntCorrection
    atoms : tuple of Atom
        What its addends are made of, in their order.
    sizes : (columns,) array
        Offset, then those of the columns of each atom. [1]
    covariance : (columns, columns) array
    log : float
        Logarithm of its probability over that of no correction.
    before, after : (bins,) arrays
        Residuals without and with it, as `asinh_loss` makes them; with it each by sizes that other parts of the time
        gave.
    covariates : mapping of (bins,) arrays
        What the terms were held against.
    equivalent : tuple of LearntCorrection
        Of other terms, which say the same of the recording: it does not tell them apart.
    """

    effect: LearntCorrection
    atoms: tuple[Atom, ...]
    sizes: Floats
    covariance: Floats
    log: float
    before: Floats
    after: Floats
    covariates: dict[Place, Floats]
    equivalent: tuple[LearntCorrection, ...]


def _of_calendar(proposal: Proposal, atoms: Sequence[Atom]) -> Proposal | None:
    """The proposal with the hour of the day in the place of a swing whose period is about that; None without one."""
    found = list(proposal.atoms)
    for place, atom in enumerate(found):
        if atom.place.covariate == "days" and atom.shape == "cosine":
            for other in atoms:
                is_near = abs(np.log(24.0 * atom.scale / other.scale)) < np.log(PERIOD_RATIO)
                if other.place.covariate == "hour_of_day" and is_near:
                    found[place] = other
    return None if found == list(proposal.atoms) else replace(proposal, atoms=tuple(found))


def of_each_target(found: Sequence[Proposal]) -> list[list[Proposal]]:
    """Proposals of each target, of which there is one a term, in their order."""
    return [[one for one in found if one.target == target] for target in dict.fromkeys(one.target for one in found)]


def columns_of_no_use(replay: Replay, bins: Bins, given: Sequence[str]) -> list[tuple[str, str]]:
    """Which of the columns that the user has given say nothing, and why."""
    if not given:
        return []
    absent = [name for name in given if name not in replay.traces.columns]
    left_out = dictionary(covariates_of(replay, bins), bins.regime != IDLE)[1]
    return [*((name, "has values in less than half of the rows") for name in absent), *left_out.items()]


def covariates_of(replay: Replay, bins: Bins) -> dict[Place, Floats]:
    """(bins,) values of what a correction may go with, as the simulator sees it."""
    prediction = replay.run()
    flow_m3h = later(replay.readings(())[0], 1.0)  # a correction goes by the flow of the second before
    return bin_covariates(replay.traces, bins, prediction.plant, prediction.level_m, flow_m3h)


def _equivalents(shop: Workshop, best: Tried, others: Sequence[Tried]) -> tuple[LearntCorrection, ...]:
    """Those of other terms, by their own addends or by those of the best one, that say the same."""

    def is_alike(one: Tried) -> bool:
        return shop.are_alike(best.residuals, one.residuals)

    found: list[LearntCorrection] = []
    for other in others:
        same = other if is_alike(other) else shop.of_target(other.proposal.target, best.proposal)
        if same is not None and is_alike(same):
            found.append(effect_of(same.proposal))
    return tuple(found)


def learn(replay: Replay, residuals: StationResiduals) -> Learnt | None:
    """The most probable correction that takes no signal further off; None where none is more probable than none.

    Parameters
    ----------
    replay : Replay
    residuals : StationResiduals
    """
    bins = residuals.bins
    covariates = covariates_of(replay, bins)
    atoms, _ = dictionary(covariates, bins.regime != IDLE)
    shop = Workshop(replay, residuals)
    found: list[Tried] = []
    for proposals_of_term in of_each_target(shop.proposals(shop.addends(atoms), covariates, shop.plain)):
        tried = next((one for one in map(shop.tried, proposals_of_term) if one is not None), None)
        if tried is not None and (daily := _of_calendar(tried.proposal, atoms)) is not None:
            tried = max(tried, shop.tried(daily) or tried, key=lambda one: one.proposal.log)
        if tried is not None and tried.proposal.log > 0.0 and not shop.spoils(tried.residuals):
            found.append(tried)
    if not found:
        return None
    best, *others = sorted(found, key=lambda one: -one.proposal.log)
    proposal = best.proposal
    return Learnt(
        effect=effect_of(proposal),
        atoms=proposal.atoms,
        sizes=proposal.sizes,
        covariance=best.gram.covariance(range(proposal.sizes.size)),
        log=proposal.log,
        before=asinh_loss(shop.plain),
        after=asinh_loss(shop.held_out(best)),
        covariates=covariates,
        equivalent=_equivalents(shop, best, others),
    )
