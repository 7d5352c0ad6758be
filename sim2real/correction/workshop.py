"""Proposals tried and refined in the simulator itself, and what they predict of times that gave no sizes."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.correction.bin_covariates import Place
from wetwell.sim2real.correction.dictionary import Atom, near
from wetwell.sim2real.correction.means import Means, means_of
from wetwell.sim2real.correction.selection import PROPOSED, Addends, Gram, Proposal, proposals
from wetwell.sim2real.correction.target import Target, targets_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import asinh_loss
from wetwell.sim2real.residuals.bins import Bins
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection

PROBE = 0.01
"""Correction by which the slopes of a term are found. [1]"""
REFINEMENTS = 12
"""Refinements of a proposal in the simulator at the most."""
WORTH_REFINING = 0.5
"""By what the logarithm of the probability rises in a refinement at the least, else it was the last one. [1]"""
SHARES = (1.0, 0.5, 0.25, 0.125)
"""Shares of a step that are tried one after the other. [1]"""
WIDTHS = (1.0, 0.125)
"""How far around the best periods and times others are tried, one after the other. [1]"""
LOOKS = 2
"""Looks after the first, each without what the one before has shown to be far off."""
BLOCKS = 6
"""Parts of time, each of which is predicted by sizes that the others give."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A proposal in the simulator: residuals and their slopes (bins, columns) at its sizes."""

    proposal: Proposal
    residuals: Floats
    slopes: Floats
    gram: Gram


class Workshop:
    """A recording and a station on which corrections are tried."""

    def __init__(self, replay: Replay, residuals: StationResiduals) -> None:
        self._replay, self._residuals = replay, residuals
        prediction = replay.run()
        self._plant, self.plain = prediction.plant, residuals.of(prediction)
        self._means = means_of(residuals.bins, self.plain)
        self.nothing = _gram(self._means, self.bounded(self.plain), np.zeros((self.plain.size, 0))).nothing
        self._sensitivities: dict[Target, Floats] = {}

    @property
    def bins(self) -> Bins:
        """Bins of the residuals."""
        return self._residuals.bins

    def bounded(self, residuals: Floats) -> Floats:
        r"""(bins,) residuals of which those far from the middle $\tilde z$ of their group count less.

        $$\tilde z + 5 \operatorname{asinh}\big((z - \tilde z) / 5\big)$$

        About the middle, and not about 0: else a constant that drives all residuals far off would make them alike.
        """
        middle = self._means.middle(residuals)
        return middle + asinh_loss(residuals - middle)

    def under(self, effect: Effect) -> Floats:
        """(bins,) residuals under one more effect.

        Raises
        ------
        ValueError
            If it does not fit the station.
        """
        return self._residuals.of(self._replay.run([effect]))

    def sensitivity(self, target: Target) -> Floats:
        """(bins,) slope of the residuals over a constant correction of a target; kept."""
        found = self._sensitivities.get(target)
        if found is None:
            constant = Proposal(target=target, atoms=(), sizes=np.zeros(1), log=0.0)
            found = self._sensitivities[target] = self.slopes(constant, self.plain)[:, 0]
        return found

    def addends(self, atoms: Sequence[Atom]) -> Addends:
        """What may be added to a correction."""
        return Addends(self._means, atoms)

    @property
    def targets(self) -> list[Target]:
        """All that may be corrected, of all pumps and mains first."""
        return sorted(targets_of(self._plant), key=lambda target: not target.is_of_all)

    def proposals(self, addends: Addends, covariates: Mapping[Place, Floats], residuals: Floats) -> list[Proposal]:
        r"""The best proposals of the best terms, of each for all pumps or mains or for the one that fits better.

        All terms are looked at first, of all pumps and mains; then the best ones, of each pump or main, too; then
        what fitted best of each. Residuals far off count less: after each look they are replaced by what a fit under
        the loss would see, $z - z_1 + z_1'$, with $z_1$ those under the best proposal and $z_1'$ what `bounded` makes
        of them.

        Parameters
        ----------
        addends : Addends
        covariates : mapping of (bins,) arrays
        residuals : (bins,) array
            Without any effect, or beside some: slopes hardly change with these.

        References
        ----------
        .. [1] P. J. Huber, Robust Statistics, 1981, section 7.8: pseudo-observations.
        """
        targets = self.targets
        looked = self._seen_in_residuals([target for target in targets if target.is_of_all])
        if not looked:
            return []

        def proposed(left: Floats) -> list[Proposal]:
            return proposals(addends, left, {one: self.sensitivity(one) for one in looked})

        found = proposed(residuals)
        likely = list(dict.fromkeys(one.target.term for one in found))[:PROPOSED]
        looked = self._seen_in_residuals([one for one in targets if one.term in likely])
        for _ in range(LOOKS):
            seen = self._seen(residuals, found[0])
            found = proposed(seen)
            looked = [next(one.target for one in found if one.target.term == term) for term in likely]
        finer: list[Proposal] = []
        for target in looked:
            nearest = [one for one in found if one.target == target]
            for width in WIDTHS:
                around = [other for atom in nearest[0].atoms for other in near(atom, covariates[atom.place], width)]
                nearest = proposals(self.addends(around), seen, {target: self.sensitivity(target)})
            finer += nearest
        return sorted(finer, key=lambda one: -one.log)

    def _seen_in_residuals(self, targets: Sequence[Target]) -> list[Target]:
        return [target for target in targets if np.any(np.abs(self.sensitivity(target)) > 0.0)]

    def _seen(self, residuals: Floats, best: Proposal) -> Floats:
        """(bins,) residuals as a fit under the loss would see them, near to a proposal."""
        after = residuals + self.sensitivity(best.target) * (best.columns(residuals.size) @ best.sizes)
        return residuals - after + self.bounded(after)

    def tried(self, proposal: Proposal) -> Tried | None:
        """A proposal refined in the simulator; None where no station works with it, or none of it matters.

        Slopes hardly change with the sizes: they are looked at again where those at hand lead no further, and last.
        """
        found = self._nearest(proposal, np.zeros(proposal.sizes.size), -np.inf)
        if found is None:
            return None
        is_fresh = True
        for _ in range(REFINEMENTS):
            before = found.proposal
            step = replace(before, sizes=self._step(self._means, found))
            better = self._nearest(step, before.sizes, before.log, found.slopes)
            if better is None and not is_fresh:
                found, is_fresh = self._at(before), True
                continue
            if better is None:
                break
            found, is_fresh = better, False
            if found.proposal.log - before.log < WORTH_REFINING:
                break
        if not is_fresh:
            found = self._at(found.proposal)
        kept = self._material(found)
        if not kept.atoms and not self._means.matters(found.slopes[:, 0] * found.proposal.sizes[0]):
            return None
        return found if len(kept.atoms) == len(found.proposal.atoms) else self.tried(kept)

    def of_target(self, target: Target, like: Proposal) -> Tried | None:
        """The most probable correction of a target with the addends of another one's; None as of `tried`."""
        columns = self.sensitivity(target)[:, None] * like.columns(self.plain.size)
        gram = _gram(self._means, self.bounded(self.plain), columns)
        return self.tried(replace(like, target=target, sizes=gram.gain(range(like.sizes.size))[1]))

    def _nearest(self, proposal: Proposal, start: Floats, least: float, slopes: Floats | None = None) -> Tried | None:
        """A proposal, or what is nearer to the sizes of a start and more probable than `least`; None without any."""
        for share in SHARES:
            sizes = start + share * (proposal.sizes - start)
            try:
                tried = self._at(replace(proposal, sizes=sizes), slopes)
            except ValueError:
                continue
            if tried.proposal.log > least:
                return tried
        return None

    def _step(self, means: Means, tried: Tried) -> Floats:
        """(columns,) sizes that come next by these means: bins far from the middle of their group count less."""
        middle = means.middle(tried.residuals)
        off = tried.residuals - middle
        known = np.where(off == 0.0, 1.0, off)
        root = np.sqrt(np.where(off == 0.0, 1.0, asinh_loss(known) / known))
        together = means.of_groups(tried.slopes)
        columns = together + root[:, None] * (tried.slopes - together)
        gram = _gram(means, middle + root * off, columns)
        return gram.gain(range(tried.proposal.sizes.size), tried.proposal.sizes)[1]

    def _material(self, found: Tried) -> Proposal:
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

    def _at(self, proposal: Proposal, slopes: Floats | None = None) -> Tried:
        """A proposal in the simulator, with slopes at its sizes or those at others."""
        residuals = self.under(effect_of(proposal))
        if slopes is None:
            slopes = self.slopes(proposal, residuals)
        gram = _gram(self._means, self.bounded(residuals), slopes)
        log = proposal.log_prior + gram.at(proposal.sizes) - self.nothing
        return Tried(proposal=replace(proposal, log=log), residuals=residuals, slopes=slopes, gram=gram)

    def slopes(self, proposal: Proposal, residuals: Floats) -> Floats:
        """(bins, columns) slopes over each size of (bins,) residuals under a proposal.

        Upwards, or downwards where the station bears no more; 0 where it bears neither.
        """
        found = np.zeros((residuals.size, proposal.sizes.size))
        for k in range(proposal.sizes.size):
            for probe in (PROBE, -PROBE):
                sizes = proposal.sizes.copy()
                sizes[k] += probe
                with suppress(ValueError):
                    found[:, k] = (self.under(effect_of(replace(proposal, sizes=sizes))) - residuals) / probe
                    break
        return found

    def spoils(self, residuals: Floats) -> bool:
        """Whether (bins,) residuals leave some signal further off than it was, by more than what is material."""
        bins = self.bins
        more = asinh_loss(residuals) ** 2 - asinh_loss(self.plain) ** 2 - bins.material**2
        return bool(np.any(np.bincount(bins.signal, more) > 0.0))

    def are_alike(self, one: Floats, other: Floats) -> bool:
        """Whether two (bins,) residuals are of corrections that say the same of the recording."""
        return self._means.are_alike(self.plain - one, self.plain - other)

    def held_out(self, tried: Tried) -> Floats:
        """(bins,) residuals where each part of the time is predicted by sizes that the others gave."""
        second, of_bin = self.bins.second, self._means.of_bin
        block_of_cell = np.zeros(self._means.counts.size, dtype=np.int64)
        block_of_cell[of_bin] = np.minimum(second * BLOCKS // (int(second.max()) + 1), BLOCKS - 1)
        found = tried.residuals.copy()
        for one in range(BLOCKS):
            held = block_of_cell == one
            change = self._step(self._means.without(held), tried) - tried.proposal.sizes
            found[held[of_bin]] += tried.slopes[held[of_bin]] @ change
        return found


def _gram(means: Means, residuals: Floats, columns: Floats) -> Gram:
    """Of (bins,) residuals and (bins, k) columns."""
    return Gram(means.products(means.of(np.column_stack([residuals, columns]))))


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
    target, offset = proposal.target, float(proposal.sizes[0])
    return LearntCorrection(term=target.term, pump=target.pump, main=target.main, offset=offset, part=tuple(parts))
