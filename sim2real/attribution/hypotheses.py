"""All hypotheses that were weighed: which may be the answer, which are near, and what the posterior is made of."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.promise import Beside
from wetwell.sim2real.attribution.trials import Each
from wetwell.sim2real.attribution.weighing.hypothesis import Hypothesis
from wetwell.sim2real.attribution.weighing.scales import Scales
from wetwell.sim2real.attribution.weighing.settling import settled
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import OFFSET
from wetwell.sim2real.likelihood.evidence import cell_weights
from wetwell.sim2real.likelihood.falls import Falls
from wetwell.sim2real.likelihood.flexible import flexible_factor
from wetwell.sim2real.likelihood.posterior import UnnamedWeight, Weight

HOPELESS = (0.5, 50.0)
"""Share of what the best of some fits explains, and sum of squares beyond that, by which a fit may be behind it."""
MOST_COMPANIONS = 1
"""Effects of a set that are too small to be told: the inertia of the water beside a lag."""
FLEXED = 4
"""Sets, the best first, beside which something unknown is weighed: it needs what explains most."""

MORE_GAINED = 4.0
"""Times what a first step promises that settling has gained at the most, on looked-at recordings."""


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

    Attributes
    ----------
    scales : Scales
        What weighs fits.
    """

    def __init__(
        self,
        fitter: Fitter,
        cells: Cells,
        each: Each,
        named: Collection[int] = (),
        falls: Falls | None = None,
    ) -> None:
        self._fitter, self._each, self._named, self._falls = fitter, each, named, falls
        self.scales = Scales(fitter, cells)
        self._none = self.scales.none
        self._surprise = cell_weights(self._none.evidence, self._none.form)
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
            found = list(self._each(self.scales.weigh, hopeful))
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
        cells = np.array([self.scales.plain, *(self.scales.means(fit) for fit in fits)]).T
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
            fit
            for fit in self._hopeful([best, *fits])
            if fit is not best and not self._is_known(self.scales.means(fit))
        ]
        found = self._each(self.scales.weigh, list(self._each(self._fitter.refine, hopeful)))
        self._unnamed += [one for one in found if one.is_there and one.fit.names[-1] in one.told]

    def _is_known(self, residuals: Floats) -> bool:
        """Whether no material difference parts (cells,) residuals from those of a set that may be the answer.

        Its parameters may be any that the recording leaves open: a little more of a lag parts nothing.
        """
        return any(self.scales.is_within(self.scales.apart(one, residuals), 1.0) for one in self.possible)

    def settle(self) -> None:
        """Take what may be the answer to where the recording is likeliest, as long as another answer is near.

        A fit is where another loss is least. What a step along the slopes gains is replayed, and weighed anew.
        """
        are_settled: set[int] = set()
        while True:
            likely = [*self.weighed[:FLEXED], *self._likeliest_unnamed()]
            least = max(one.evidence.log for one in likely)
            near = [one for one in likely if _at_most(one) >= least]
            leading = [one for one in near if id(one) not in are_settled]
            if not leading or len({one.told for one in near}) == 1:
                return
            found = self._each(partial(settled, self.scales), leading)
            after = {id(one): its for one, its in zip(leading, found, strict=True)}
            are_settled |= {id(one) for one in after.values()}
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
            answer for answer in answers if self.scales.is_within(self.of(answer).evidence.residuals - own, OFFSET)
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
        one = known if known is not None and known.fit is fit else self.scales.weigh(fit)
        return Beside(
            weights=cell_weights(one.evidence, one.form),
            residuals=self.scales.means(fit),
            slopes=one.slopes,
            position=fit.position,
            lacks=self.weighed[0].evidence.log - one.evidence.log,
        )

    def _flexible(self, one: Hypothesis) -> float:
        return flexible_factor(one.evidence, one.form, self._named, self._falls)


def _at_most(one: Hypothesis) -> float:
    """Logarithm of the evidence that a hypothesis may have once it is settled."""
    return one.evidence.log + MORE_GAINED * one.evidence.gained


def _is_near_best(left: Floats) -> Flags:
    """Whether each sum of squares but the first, that of no effects, is near the least one."""
    plain, least = left[0], left[1:].min()
    return np.asarray(left[1:] < min(least + HOPELESS[0] * (plain - least) + HOPELESS[1], plain), dtype=np.bool_)
