"""Fits as hypotheses: what their cells say of them, and whether each of their effects is there at all."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.fitting import ROUNDS, Fit, Fitter
from wetwell.sim2real.attribution.intervals import are_named, left_open
from wetwell.sim2real.attribution.presence import (
    are_needed,
    could_others,
    is_only_late,
    own_signature,
    strengths_of,
    time_constant_s,
    unshifted,
)
from wetwell.sim2real.attribution.promise import Beside
from wetwell.sim2real.attribution.trials import Each
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import GOOD, LATE, OFFSET, POOR_FORM, Form, no_form
from wetwell.sim2real.likelihood.evidence import Evidence, Member, cell_weights, evidence, evidence_of_none
from wetwell.sim2real.likelihood.falls import Falls
from wetwell.sim2real.likelihood.flexible import flexible_factor
from wetwell.sim2real.likelihood.posterior import UnnamedWeight, Weight
from wetwell.sim2real.residuals.asinh_loss import residuals_of
from wetwell.sim2real.residuals.rates import rate_of
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.effects.effect import Effect

HOPELESS = (0.5, 50.0)
"""Share of what the best of some fits explains, and sum of squares beyond that, by which a fit may be behind it."""
MOST_COMPANIONS = 1
"""Effects of a set that are too small to be told: the inertia of the water beside a lag."""
FLEXED = 4
"""Sets, the best first, beside which something unknown is weighed: it needs what explains most."""

MORE_GAINED = 4.0
"""Times what a first step promises that settling has gained at the most, on looked-at recordings."""
PARTS_OF_A_STEP = (1.0, 0.5, 0.25)
"""Parts of a step that are tried: slopes do not hold for all of it."""
WORTH_A_STEP = 1.0
"""By what a step has to make the recording likelier, in the logarithm: less tells no two sets apart."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """A fit with its evidence.

    Attributes
    ----------
    fit : Fit
    evidence : Evidence
    form : Form
    slopes : (cells, parameters) array
        Change of the residuals with each parameter, over its range.
    is_there : bool
        Whether none of its effects may be neutral, and none that is told could do another's work or widens the gap.
    told : tuple of str
        Its effects that matter, in order of the alphabet. The others are companions: too small to be told.
    needed : tuple of str
        Those that matter, but for the one that the recording needs least, where it does not need it.
    """

    fit: Fit
    evidence: Evidence
    form: Form
    slopes: Floats
    is_there: bool
    told: tuple[str, ...]
    needed: tuple[str, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of its effects, in order of the alphabet."""
        return tuple(sorted(self.fit.names))

    @property
    def is_possible(self) -> bool:
        """Whether it may be the answer: each of its effects is there and matters."""
        return self.is_there and self.told == self.effects


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


class Hypotheses:
    """All that was weighed, one hypothesis for each set of names: the best.

    Parameters
    ----------
    fitter : Fitter
    cells : Cells
        Of the residuals that it fits.
    each : callable
        Weighs fits, perhaps side by side.
    named : collection of int
        Signals in which nothing unknown can be.
    falls : Falls, optional
        Of the level at rest, which only something unknown makes.
    """

    def __init__(
        self,
        fitter: Fitter,
        cells: Cells,
        each: Each,
        named: Collection[int] = (),
        falls: Falls | None = None,
    ) -> None:
        self._fitter, self._cells, self._each, self._named, self._falls = fitter, cells, each, named, falls
        self._plain = self._means(fitter.plain)
        none = evidence_of_none(cells, self._plain)
        self._none = Hypothesis(
            fit=fitter.plain,
            evidence=none,
            form=no_form(cells),
            slopes=np.zeros((self._plain.size, 0)),
            is_there=True,
            told=(),
            needed=(),
        )
        self._surprise = cell_weights(none, self._none.form)
        self._best: dict[tuple[str, ...], Hypothesis] = {(): self._none}
        self._factors: dict[tuple[str, ...], float] = {}
        self._unnamed: list[Hypothesis] = []

    @property
    def known(self) -> set[frozenset[str]]:
        """All sets of effects that were weighed."""
        return {frozenset(effects) for effects in self._best}

    @property
    def possible(self) -> list[Hypothesis]:
        """Those that may be true, the most probable recording first; that of no effects is among them."""
        found = [one for one in self._best.values() if one.is_possible]
        return sorted(found, key=lambda one: -one.evidence.log)

    @property
    def weighed(self) -> list[Hypothesis]:
        """Those that tell a possible answer, with one companion at most, the most probable recording first."""
        answers = {one.told for one in self._best.values() if one.is_possible}
        found = [
            one
            for one in self._best.values()
            if one.is_there and one.told in answers and len(one.effects) - len(one.told) <= MOST_COMPANIONS
        ]
        return sorted(found, key=lambda one: -one.evidence.log)

    def add(self, fits: Sequence[Fit]) -> None:
        """Weigh fits, but for those that explain far less than others, and keep the best of each set of names.

        Beside an effect that is not needed, or too small to be told, a set is weighed without that, too.
        """
        hopeful = self._hopeful(fits)
        while hopeful:
            found = list(self._each(self.weigh, hopeful))
            for one in found:
                known = self._best.get(one.effects)
                if known is None or (one.is_possible, one.evidence.log) > (known.is_possible, known.evidence.log):
                    self._best[one.effects] = one
            fewer = {one.needed: one.fit for one in found if one.needed not in self._best}
            alone = [self._fitter.only(fit, names) for names, fit in fewer.items()]
            hopeful = list(self._each(self._fitter.refine, [fit for fit in alone if fit is not None]))

    def _hopeful(self, fits: Sequence[Fit]) -> list[Fit]:
        """Fits that explain nearly as much as the best one: of the loss, or of what the likelihood is surprised by.

        A limit may take much of the loss in seconds in which a model is often wrong.
        """
        if not fits:
            return []
        cells = np.array([self._plain, *(self._means(fit) for fit in fits)]).T
        squares = np.diag(self._surprise.products(cells))
        losses = np.array([self._fitter.cost(fit) for fit in (self._fitter.plain, *fits)])
        is_hopeful = np.any([_is_near_best(one) for one in (losses, squares)], axis=0)
        return [fit for fit, it_is in zip(fits, is_hopeful, strict=True) if it_is]

    def add_unnamed(self, fits: Sequence[Fit]) -> None:
        """Weigh fits whose last candidate is a correction.

        Those are left out that explain far less than the best set, and those that say what a set says.
        """
        best = self.weighed[0].fit
        hopeful = [
            fit for fit in self._hopeful([best, *fits]) if fit is not best and not self._is_known(self._means(fit))
        ]
        found = self._each(self.weigh, list(self._each(self._fitter.refine, hopeful)))
        self._unnamed += [one for one in found if one.is_there and one.fit.names[-1] in one.told]

    def _is_known(self, residuals: Floats) -> bool:
        """Whether no material difference parts (cells,) residuals from those of a set that may be the answer.

        Its parameters may be any that the recording leaves open: a little more of a lag parts nothing.
        """
        return any(self._is_within(self._apart(one, residuals), 1.0) for one in self.possible)

    def _apart(self, one: Hypothesis, residuals: Floats) -> Floats:
        """(cells,) by how much a hypothesis differs from some residuals, its parameters where they differ least."""
        position, spread = one.fit.position, left_open(one.evidence)
        room = np.maximum(-position, -spread), np.minimum(1.0 - position, spread)
        return own_signature(one.evidence.residuals - residuals, one.slopes, self._cells.allowed, room)

    def settle(self) -> None:
        """Take what may be the answer to where the recording is likeliest, as long as another answer is near.

        A fit is where another loss is least. What a step along the slopes gains is replayed, and weighed anew.
        """
        settled: set[int] = set()
        while True:
            likely = [*self.weighed[:FLEXED], *self._likeliest_unnamed()]
            least = max(one.evidence.log for one in likely)
            near = [one for one in likely if _at_most(one) >= least]
            leading = [one for one in near if id(one) not in settled]
            if not leading or len({one.told for one in near}) == 1:
                return
            after = {id(one): found for one, found in zip(leading, self._each(self._settled, leading), strict=True)}
            settled |= {id(one) for one in after.values()}
            self._best = {effects: after.get(id(one), one) for effects, one in self._best.items()}
            self._unnamed = [after.get(id(one), one) for one in self._unnamed]

    def of(self, effects: Sequence[str]) -> Hypothesis:
        """The hypothesis of some effects."""
        return self._best[tuple(sorted(effects))]

    def companions(self, effects: Sequence[str]) -> Fit:
        """What acts in the hypothesis of some effects and is too small to be told, without those that are told."""
        one = self._best.get(tuple(sorted(effects)), self._none)
        return self._fitter.only(one.fit, set(one.effects) - set(one.told)) or self._none.fit

    def telling(self, effects: Sequence[str]) -> Hypothesis:
        """The likeliest hypothesis that tells some effects, perhaps beside a companion."""
        return next(one for one in self.weighed if one.told == tuple(sorted(effects)))

    def alike(self, effects: Sequence[str], answers: Sequence[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
        """Those of some answers whose readings differ from those of a set by no more than a good model is off."""
        own = self.of(effects).evidence.residuals
        return tuple(
            answer for answer in answers if self._is_within(self.of(answer).evidence.residuals - own, OFFSET)
        )

    def rule_out(self, effects: Sequence[str]) -> None:
        """Take a set for none that may be the answer."""
        key = tuple(sorted(effects))
        self._best[key] = replace(self._best[key], is_there=False)

    def weights(self) -> list[Weight]:
        """What the posterior is made of."""
        weighed = self.weighed
        flexed = [*weighed[:FLEXED], *(one for one in weighed[FLEXED:] if one is self._none)]
        flexed = [one for one in flexed if one.effects not in self._factors]
        self._factors |= zip((one.effects for one in flexed), self._each(self._flexible, flexed), strict=True)
        return [
            Weight(
                effects=one.told,
                acting=one.effects,
                log=one.evidence.log,
                log_flexible=self._factors.get(one.effects, -np.inf),
            )
            for one in weighed
        ]

    def unnamed_weights(self) -> list[UnnamedWeight]:
        """Corrections that may be what is unknown, the likeliest."""
        likely = self._likeliest_unnamed()
        return [
            UnnamedWeight(
                acting=tuple(sorted(fit.names[:-1])),
                component=correction.component,
                log=one.evidence.log + correction.log_prior,
                log_flexible=factor,
                is_apart=not self._is_known(one.evidence.residuals),
            )
            for one, factor in zip(likely, self._each(self._flexible, likely), strict=True)
            for fit, correction in ((one.fit, one.fit.candidates[-1]),)
        ]

    def _likeliest_unnamed(self) -> list[Hypothesis]:
        return sorted(self._unnamed, key=lambda one: -one.evidence.log)[:FLEXED]

    def beside(self, fits: Sequence[Fit]) -> list[Beside]:
        """Fits as what further effects come beside."""
        return list(self._each(self._beside, fits))

    def _beside(self, fit: Fit) -> Beside:
        known = self._best.get(tuple(sorted(fit.names)))
        one = known if known is not None and known.fit is fit else self.weigh(fit)
        return Beside(
            weights=cell_weights(one.evidence, one.form),
            residuals=self._means(fit),
            slopes=one.slopes,
            position=fit.position,
            lacks=self.weighed[0].evidence.log - one.evidence.log,
        )

    def _settled(self, one: Hypothesis) -> Hypothesis:
        for _ in range(ROUNDS):
            if one.evidence.gained <= WORTH_A_STEP:
                break
            tried = [one]
            for its in self._steps(one):
                if its.evidence.log > one.evidence.log + WORTH_A_STEP:
                    one = its
                    break
                tried.append(its)
            else:
                return _as_replayed(tried)
        return one

    def _steps(self, one: Hypothesis) -> Iterator[Hypothesis]:
        """A hypothesis a step further, then half of it, and so on."""
        for part in PARTS_OF_A_STEP:
            position = one.fit.position + part * one.evidence.step
            moved = self._fitter.at(one.fit.candidates, one.fit.split(position))
            if moved is not None:
                yield self.weigh(moved)

    def _flexible(self, one: Hypothesis) -> float:
        return flexible_factor(one.evidence, one.form, self._named, self._falls)

    def _means(self, fit: Fit) -> Floats:
        return self._cells.means(residuals_of(fit.residuals))

    def _shown(self, fit: Fit) -> _Shown:
        cells, residuals = self._cells, self._means(fit)
        fewer = [self._fitter.without(fit, member) for member in range(len(fit.names))]
        signatures = [np.zeros(residuals.size) if one is None else self._means(one) - residuals for one in fewer]
        late = [
            np.zeros(residuals.size) if one is None else self._late(fit, member, one)
            for member, one in enumerate(fewer)
        ]
        slopes, cost = self._fitter.slopes(fit), self._fitter.cost(fit)
        return _Shown(
            residuals=residuals,
            slopes=np.array([cells.means(column) for column in slopes.T]).reshape(-1, residuals.size).T,
            signatures=signatures,
            late=late,
            form=self._form(fit, signatures, self._plain - residuals, late),
            may_each_lack=None not in fewer,
            widening=frozenset(k for k, one in enumerate(fewer) if self._fitter.cost(one) < cost),
        )

    def weigh(self, fit: Fit) -> Hypothesis:
        """A fit with its evidence."""
        shown = self._shown(fit)
        of_member = np.repeat(np.arange(len(fit.points)), [point.size for point in fit.points])
        members = [
            Member(parameters=np.flatnonzero(of_member == k), neutral=neutral, absent=signature)
            for k, (neutral, signature) in enumerate(zip(strengths_of(fit), shown.signatures, strict=True))
        ]
        found = evidence(self._cells, shown.residuals, shown.slopes, shown.form, fit.position, members)
        told = [
            member
            for member, (signature, late) in enumerate(zip(shown.signatures, shown.late, strict=True))
            if EFFECTS[fit.names[member]].is_told
            and not is_only_late(fit, member, self._fitter.station.materiality.time_s)
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

    def _form(self, fit: Fit, signatures: Sequence[Floats], explained: Floats, late: Sequence[Floats]) -> Form:
        swings, fixed = np.zeros((2, self._cells.group.size))
        for effect, signature in zip(fit.effects, signatures, strict=True):
            if type(effect).force is not Effect.force:
                swings += self._cells.block_squares(signature)
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
        time_s = np.hypot(self._fitter.station.materiality.time_s, POOR_FORM * time_constant_s(fit, member))
        return np.asarray(time_s * self._cells.means(rate_of(self._fitter.bins, explained)), dtype=np.float64)

    def _is_within(self, change: Floats, share: float) -> bool:
        """Whether (cells,) changes are within a share of what is allowed in each group."""
        most = self._cells.group_squares(share * self._cells.allowed)
        return bool(np.all(self._cells.group_squares(change) <= most))

    def _could_others(self, fit: Fit, member: int, is_other: Flags, shown: _Shown) -> bool:
        """Whether other parameters could do all of an effect's work, but for what is allowed."""

        def left_of(its: Floats) -> Floats | None:
            position = fit.position.copy()
            position[is_other] = its
            moved = self._fitter.without(replace(fit, points=fit.split(position)), member)
            return None if moved is None else self._means(moved) - shown.residuals

        others, is_within = shown.slopes[:, is_other], partial(self._is_within, share=1.0)
        return could_others(
            shown.signatures[member], others, fit.position[is_other], self._cells.allowed, is_within, left_of
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
        cells = self._cells
        others = np.maximum(form.signature**2 - signature**2, 0.0)
        wrong = cells.allowed**2 + (LATE[2] * late) ** 2 + 2.0 * GOOD.form**2 * others
        own = unshifted(cells, signature, late)
        return bool(np.any(cells.group_squares(own) > cells.group_squares(np.sqrt(wrong))))


def _as_replayed(tried: Sequence[Hypothesis]) -> Hypothesis:
    """The likeliest of places by what was replayed there: no step along the slopes keeps what they promise."""
    best = max(tried, key=lambda one: one.evidence.log - one.evidence.gained)
    return replace(best, evidence=replace(best.evidence, log=best.evidence.log - best.evidence.gained, gained=0.0))


def _at_most(one: Hypothesis) -> float:
    """Logarithm of the evidence that a hypothesis may have once it is settled."""
    return one.evidence.log + MORE_GAINED * one.evidence.gained


def _is_near_best(left: Floats) -> Flags:
    """Whether each sum of squares but the first, that of no effects, is near the least one."""
    plain, least = left[0], left[1:].min()
    return np.asarray(left[1:] < min(least + HOPELESS[0] * (plain - least) + HOPELESS[1], plain), dtype=np.bool_)
