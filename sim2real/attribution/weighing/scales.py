"""Weighs a fit: its evidence, which of its effects are there, and which of them matter."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.intervals import are_named, left_open
from wetwell.sim2real.attribution.weighing.hypothesis import Hypothesis
from wetwell.sim2real.attribution.weighing.presence import (
    are_needed,
    could_others,
    is_only_late,
    own_signature,
    strengths_of,
    time_constant_s,
    unshifted,
)
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import GOOD, LATE, POOR_FORM, Form, no_form
from wetwell.sim2real.likelihood.evidence import Member, evidence, evidence_of_none
from wetwell.sim2real.residuals.asinh_loss import residuals_of
from wetwell.sim2real.residuals.rates import rate_of
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.effects.effect import Effect


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shown:
    """Cells of a fit: what is left, its slopes, what each effect explains and what it does late, and their form.

    `may_each_lack` says that the station can be without each of them, and `widening` which of them widen the gap: all
    else as it is, the simulator is nearer to the recording without them.
    """

    residuals: Floats
    slopes: Floats
    signatures: Sequence[Floats]
    late: Sequence[Floats]
    form: Form
    may_each_lack: bool
    widening: frozenset[int]


class Scales:
    """What weighs fits by their cells.

    Parameters
    ----------
    fitter : Fitter
    cells : Cells
        Of the residuals that it fits.

    Attributes
    ----------
    plain : (cells,) array
        Means of the residuals without any effect.
    none : Hypothesis
        That of no effects.
    """

    def __init__(self, fitter: Fitter, cells: Cells) -> None:
        self.fitter, self.cells = fitter, cells
        self.plain = self.means(fitter.plain)
        self.none = Hypothesis(
            fit=fitter.plain,
            evidence=evidence_of_none(cells, self.plain),
            form=no_form(cells),
            slopes=np.zeros((self.plain.size, 0)),
            is_there=True,
            told=(),
            needed=(),
        )

    def means(self, fit: Fit) -> Floats:
        """(cells,) means of the residuals of a fit."""
        return self.cells.means(residuals_of(fit.residuals))

    def weigh(self, fit: Fit) -> Hypothesis:
        """A fit with its evidence."""
        shown = self._shown(fit)
        of_member = np.repeat(np.arange(len(fit.points)), [point.size for point in fit.points])
        members = [
            Member(parameters=np.flatnonzero(of_member == k), neutral=neutral, absent=signature)
            for k, (neutral, signature) in enumerate(zip(strengths_of(fit), shown.signatures, strict=True))
        ]
        found = evidence(self.cells, shown.residuals, shown.slopes, shown.form, fit.position, members)
        told = [
            member
            for member, (signature, late) in enumerate(zip(shown.signatures, shown.late, strict=True))
            if EFFECTS[fit.names[member]].is_told
            and not is_only_late(fit, member, self.fitter.station.materiality.time_s)
            and self._matters(signature, shown.form, shown.form.late - late)
        ]
        is_needed = are_needed(found, [len(one.neutral) for one in members])
        least = min(told, key=lambda member: found.needed[member], default=None)
        return Hypothesis(
            fit=fit,
            evidence=found,
            form=shown.form,
            slopes=shown.slopes,
            is_there=shown.may_each_lack
            and bool(is_needed.all())
            and shown.widening.isdisjoint(told)
            and are_named(fit, found, [fit.names[member] for member in told])
            and not any(self._could_others(fit, k, np.isin(of_member, told) & (of_member != k), shown) for k in told),
            told=tuple(sorted(fit.names[member] for member in told)),
            needed=tuple(sorted(fit.names[member] for member in told if is_needed[member] or member != least)),
        )

    def is_within(self, change: Floats, share: float) -> bool:
        """Whether (cells,) changes are within a share of what is allowed in each group."""
        most = self.cells.group_squares(share * self.cells.allowed)
        return bool(np.all(self.cells.group_squares(change) <= most))

    def apart(self, one: Hypothesis, residuals: Floats) -> Floats:
        """(cells,) by how much a hypothesis differs from some residuals, its parameters where they differ least."""
        position, spread = one.fit.position, left_open(one.evidence)
        room = np.maximum(-position, -spread), np.minimum(1.0 - position, spread)
        return own_signature(one.evidence.residuals - residuals, one.slopes, self.cells.allowed, room)

    def _shown(self, fit: Fit) -> _Shown:
        cells, residuals = self.cells, self.means(fit)
        fewer = [self.fitter.without(fit, member) for member in range(len(fit.names))]
        signatures = [np.zeros(residuals.size) if one is None else self.means(one) - residuals for one in fewer]
        late = [
            np.zeros(residuals.size) if one is None else self._late(fit, member, one)
            for member, one in enumerate(fewer)
        ]
        slopes, cost = self.fitter.slopes(fit), self.fitter.cost(fit)
        return _Shown(
            residuals=residuals,
            slopes=np.array([cells.means(column) for column in slopes.T]).reshape(-1, residuals.size).T,
            signatures=signatures,
            late=late,
            form=self._form(fit, signatures, self.plain - residuals, late),
            may_each_lack=None not in fewer,
            widening=frozenset(k for k, one in enumerate(fewer) if self.fitter.cost(one) < cost),
        )

    def _form(self, fit: Fit, signatures: Sequence[Floats], explained: Floats, late: Sequence[Floats]) -> Form:
        swings, fixed = np.zeros((2, self.cells.group.size))
        for effect, signature in zip(fit.effects, signatures, strict=True):
            if type(effect).force is not Effect.force:
                swings += self.cells.block_squares(signature)
            if effect.has_one_form:
                fixed += signature**2
        squares = np.sum(np.square(signatures), axis=0)
        return Form(
            signature=np.maximum(np.sqrt(squares), np.abs(explained)),
            fixed=np.divide(fixed, squares, out=np.zeros_like(fixed), where=squares > 0.0),
            swinging=np.sqrt(swings),
            late=np.sum(late, axis=0),
        )

    def _late(self, fit: Fit, member: int, fewer: Fit) -> Floats:
        """(cells,) change of what an effect explains, within a time that is material or a share of its own."""
        explained = residuals_of(fewer.residuals) - residuals_of(fit.residuals)
        time_s = np.hypot(self.fitter.station.materiality.time_s, POOR_FORM * time_constant_s(fit, member))
        return np.asarray(time_s * self.cells.means(rate_of(self.fitter.bins, explained)), dtype=np.float64)

    def _could_others(self, fit: Fit, member: int, is_other: Flags, shown: _Shown) -> bool:
        """Whether other parameters could do all of an effect's work, but for what is allowed."""

        def left_of(its: Floats) -> Floats | None:
            position = fit.position.copy()
            position[is_other] = its
            moved = self.fitter.without(replace(fit, points=fit.split(position)), member)
            return None if moved is None else self.means(moved) - shown.residuals

        others, is_within = shown.slopes[:, is_other], partial(self.is_within, share=1.0)
        return could_others(
            shown.signatures[member], others, fit.position[is_other], self.cells.allowed, is_within, left_of
        )

    def _matters(self, signature: Floats, form: Form, late: Floats) -> bool:
        """Whether an effect does more in some group than what is allowed, and than the others may have wrong there.

        All of a block is late alike, but for a share: what a shift of the others does is not the effect's own.

        Parameters
        ----------
        signature : (cells,) array
            Of the effect.
        form : Form
            Of all effects of the set.
        late : (cells,) array
            Of the others.
        """
        cells = self.cells
        others = np.maximum(form.signature**2 - signature**2, 0.0)
        wrong = cells.allowed**2 + (LATE[2] * late) ** 2 + 2.0 * GOOD.form**2 * others
        own = unshifted(cells, signature, late)
        return bool(np.any(cells.group_squares(own) > cells.group_squares(np.sqrt(wrong))))
