"""Learn a correction: terms screened by their slopes, the best ones tried and refined in the simulator itself."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.correction.bin_covariates import Place, bin_covariates
from wetwell.sim2real.correction.dictionary import PERIOD_RATIO, Atom, dictionary, near
from wetwell.sim2real.correction.means import means_of
from wetwell.sim2real.correction.selection import PROPOSED, SIZE_PRIOR, TEMPER, Gram, Proposal, proposals
from wetwell.sim2real.recording.regimes import IDLE
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import asinh_loss
from wetwell.sim2real.residuals.bins import Bins
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.corrections.parts import TERMS, Term
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection

PROBE = 0.01
"""Correction by which the slopes of a term are found. [1]"""
REFINEMENTS = 4
"""Refinements of a proposal in the simulator."""
LOOKS = 2
"""Looks at all terms after the first, each without what the one before has shown to be far off."""
BLOCKS = 6
"""Parts of time, each of which is predicted by sizes that the others give."""


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
    """

    effect: LearntCorrection
    atoms: tuple[Atom, ...]
    sizes: Floats
    covariance: Floats
    log: float
    before: Floats
    after: Floats
    covariates: dict[Place, Floats]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tried:
    """A proposal in the simulator: residuals and their slopes (bins, columns) at its sizes."""

    proposal: Proposal
    residuals: Floats
    slopes: Floats
    gram: Gram


class Workshop:
    """A recording and a station on which corrections are tried."""

    def __init__(self, replay: Replay, residuals: StationResiduals) -> None:
        self._replay, self._residuals = replay, residuals
        self._means = means_of(residuals.bins)
        self.plain = residuals.of(replay.run())
        self.nothing = Gram(self._means, asinh_loss(self.plain), np.zeros((self.plain.size, 0))).nothing

    @property
    def bins(self) -> Bins:
        """Bins of the residuals."""
        return self._residuals.bins

    def under(self, effect: Effect) -> Floats:
        """(bins,) residuals under one more effect.

        Raises
        ------
        ValueError
            If it does not fit the station.
        """
        return self._residuals.of(self._replay.run([effect]))

    def sensitivities(self) -> dict[Term, Floats]:
        """(bins,) slope of the residuals over a constant correction of each term that they see."""
        slopes = {
            term: (self.under(LearntCorrection(term=term, offset=PROBE)) - self.plain) / PROBE for term in TERMS
        }
        return {term: slope for term, slope in slopes.items() if np.any(np.abs(slope) > 0.0)}

    def proposals(self, atoms: Sequence[Atom], covariates: Mapping[Place, Floats]) -> list[Proposal]:
        r"""The best proposal of each of the best terms, the most probable first.

        Residuals far off count less: after each look they are replaced by what a fit under the loss would see,
        $z - z_1 + 5 \operatorname{asinh}(z_1 / 5)$, with $z_1$ those under the best proposal.

        References
        ----------
        .. [1] P. J. Huber, Robust Statistics, 1981, section 7.8: pseudo-observations.
        """
        slopes, seen = self.sensitivities(), self.plain
        found = proposals(self._means, seen, atoms, slopes)
        for _ in range(LOOKS):
            best = found[0]
            columns = np.column_stack([np.ones(seen.size), *(atom.columns for atom in best.atoms)])
            after = self.plain + slopes[best.term] * (columns @ best.sizes)
            seen = self.plain - after + asinh_loss(after)
            likely = dict.fromkeys([one.term for one in found])
            found = proposals(self._means, seen, atoms, {term: slopes[term] for term in list(likely)[:PROPOSED]})
        finer: list[Proposal] = []
        for term in dict.fromkeys(one.term for one in found):
            best = next(one for one in found if one.term == term)
            around = [other for atom in best.atoms for other in near(atom, covariates[atom.place])]
            finer += proposals(self._means, seen, around, {term: slopes[term]})
        return sorted(finer, key=lambda one: -one.log)

    def tried(self, proposal: Proposal) -> _Tried | None:
        """A proposal refined in the simulator; None where no station works with it, or none of it matters."""
        found: _Tried | None = None
        for _ in range(REFINEMENTS):
            try:
                now = self._at(proposal)
            except ValueError:
                break
            if found is not None and now.proposal.log <= found.proposal.log:
                break
            found = now
            _, sizes = self._robust(now).gain(range(proposal.sizes.size), proposal.sizes)
            proposal = replace(proposal, sizes=sizes)
        if found is None:
            return None
        kept = self._material(found)
        if not kept.atoms and not self._means.matters(found.slopes[:, 0] * found.proposal.sizes[0]):
            return None
        return found if len(kept.atoms) == len(found.proposal.atoms) else self.tried(kept)

    def _robust(self, tried: _Tried) -> Gram:
        """Products of residuals that count by what the loss makes of them: the weights of the next step."""
        root = np.sqrt(_weight(tried.residuals))
        return Gram(self._means, tried.residuals * root, tried.slopes * root[:, None])

    def _material(self, found: _Tried) -> Proposal:
        """The proposal without addends that matter nowhere."""
        whole = found.proposal
        ends = np.cumsum([1, *(atom.columns.shape[1] for atom in whole.atoms)])
        columns = list(pairwise(ends))
        kept = [
            number
            for number, (begin, end) in enumerate(columns)
            if self._means.matters(found.slopes[:, begin:end] @ whole.sizes[begin:end])
        ]
        sizes = [whole.sizes[:1], *(whole.sizes[slice(*columns[number])] for number in kept)]
        return replace(whole, atoms=tuple(whole.atoms[number] for number in kept), sizes=np.concatenate(sizes))

    def _at(self, proposal: Proposal) -> _Tried:
        residuals = self.under(effect_of(proposal))
        slopes = np.zeros((residuals.size, proposal.sizes.size))
        for k in range(proposal.sizes.size):
            sizes = proposal.sizes.copy()
            sizes[k] += PROBE
            slopes[:, k] = (self.under(effect_of(replace(proposal, sizes=sizes))) - residuals) / PROBE
        gram = Gram(self._means, asinh_loss(residuals), slopes)
        log = proposal.prior + TEMPER * (gram.at(proposal.sizes) - self.nothing)
        return _Tried(proposal=replace(proposal, log=log), residuals=residuals, slopes=slopes, gram=gram)

    def held_out(self, tried: _Tried) -> Floats:
        """(bins,) residuals where each part of the time is predicted by sizes that the others gave."""
        bins = self.bins
        block = np.minimum(bins.second * BLOCKS // (int(bins.second.max()) + 1), BLOCKS - 1)
        weight = _weight(tried.residuals) / (1.0 + bins.material**2)
        start, found = tried.proposal.sizes, tried.residuals.copy()
        for one in range(BLOCKS):
            given = block != one
            slopes = tried.slopes[given]
            curvature = slopes.T @ (weight[given, None] * slopes) + np.eye(start.size) / SIZE_PRIOR**2
            pull = slopes.T @ (weight[given] * tried.residuals[given]) + start / SIZE_PRIOR**2
            found[~given] -= tried.slopes[~given] @ np.linalg.solve(curvature, pull)
        return found


def _weight(residuals: Floats) -> Floats:
    """(bins,) weights of squares under which least squares goes where the loss leads."""
    known = np.where(residuals == 0.0, 1.0, residuals)
    return np.where(residuals == 0.0, 1.0, asinh_loss(known) / known)


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


def _first_of_each(found: Sequence[Proposal]) -> list[list[Proposal]]:
    """Proposals of each term, in their order."""
    return [[one for one in found if one.term == term] for term in dict.fromkeys(one.term for one in found)]


def effect_of(proposal: Proposal) -> LearntCorrection:
    """Effect of a proposal.

    Raises
    ------
    ValueError
        If its sizes are beyond what an effect may have; pydantic's.
    """
    ends = np.cumsum([1, *(atom.columns.shape[1] for atom in proposal.atoms)])
    parts = [
        atom.part(sizes) for atom, sizes in zip(proposal.atoms, np.split(proposal.sizes, ends)[1:-1], strict=True)
    ]
    return LearntCorrection(term=proposal.term, offset=float(proposal.sizes[0]), part=tuple(parts))


def columns_of_no_use(replay: Replay, bins: Bins, given: Sequence[str]) -> list[tuple[str, str]]:
    """Which of the columns that the user has given say nothing, and why."""
    if not given:
        return []
    absent = [name for name in given if name not in replay.traces.columns]
    left_out = dictionary(_covariates(replay, bins), bins.regime != IDLE)[1]
    return [*((name, "has values in less than half of the rows") for name in absent), *left_out.items()]


def _covariates(replay: Replay, bins: Bins) -> dict[Place, Floats]:
    prediction = replay.run()
    flow_m3h = replay.readings(())[0]
    return bin_covariates(replay.traces, bins, prediction.plant, prediction.level_m, flow_m3h)


def learn(replay: Replay, residuals: StationResiduals) -> Learnt | None:
    """The most probable correction; None where none is more probable.

    Parameters
    ----------
    replay : Replay
    residuals : StationResiduals
    """
    bins = residuals.bins
    covariates = _covariates(replay, bins)
    atoms, _ = dictionary(covariates, bins.regime != IDLE)
    shop = Workshop(replay, residuals)
    best: _Tried | None = None
    for proposals_of_term in _first_of_each(shop.proposals(atoms, covariates)):
        tried = next((one for one in map(shop.tried, proposals_of_term) if one is not None), None)
        if tried is not None and (daily := _of_calendar(tried.proposal, atoms)) is not None:
            tried = max(tried, shop.tried(daily) or tried, key=lambda one: one.proposal.log)
        if tried is not None and tried.proposal.log > (0.0 if best is None else best.proposal.log):
            best = tried
    if best is None:
        return None
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
    )
