"""Where a model is good and where it is poor: the likeliest way, by what a fit leaves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.likelihood.cells import POORLY, Block
from wetwell.sim2real.likelihood.covariance import (
    DIFFERING,
    GOOD,
    HARDLY_DIFFERENT,
    LATE,
    POOR,
    Allowance,
    Errors,
    Form,
    of_form,
)
from wetwell.sim2real.likelihood.scatter import scatter_of, settled
from wetwell.sim2real.residuals.bins import START_LEVEL, STOP_LEVEL


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """Errors that there may be, and whether these are poor."""

    errors: Errors
    is_poor: bool


SPAN_WAYS = (Way(errors=GOOD, is_poor=False), Way(errors=POOR, is_poor=True))
"""What may be wrong alike for all pumps and cycles in a span of time."""
BETTER, POORER = GOOD.times(DIFFERING), POOR.times(DIFFERING)
OWN_WAYS = (
    Way(errors=HARDLY_DIFFERENT, is_poor=False),
    Way(errors=BETTER, is_poor=False),
    Way(errors=POORER, is_poor=True),
)
"""What may differ between pumps."""
CHANGING_WAYS = tuple(
    Way(errors=Errors(offset=offset, form=form), is_poor=offset == POORER.offset or form == POORER.form)
    for offset, form in product(
        (BETTER.offset, POORER.offset), (0.0, HARDLY_DIFFERENT.form, BETTER.form, POORER.form)
    )
)
"""What may differ between cycles."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ways:
    """What may be wrong in a block: alike in a span, in a group by itself, and changing from cycle to cycle.

    `may_be_prone` says that a block which is poor in all its spans is looked at besides. By means and scatter a span
    may look good that is poor: a shift in time, which is no offset, may explain how cells differ from cycle to cycle
    once they may be off alike.
    """

    span: Sequence[Way] = SPAN_WAYS
    own: Sequence[Way] = OWN_WAYS
    changing: Sequence[Way] = CHANGING_WAYS
    may_be_prone: bool = False


def _no_larger(ways: Sequence[Way]) -> tuple[Way, ...]:
    """The same with poor models no further off than good ones, but for what effects do there."""
    good = min(way.errors.offset for way in ways)
    return tuple(replace(way, errors=replace(way.errors, offset=good)) for way in ways)


KNOWN, RIGHT = Ways(), Ways(may_be_prone=True)
"""Of a right model."""
RIGHT_AT_EVENTS = Ways(span=_no_larger(SPAN_WAYS), own=_no_larger(OWN_WAYS), may_be_prone=True)
"""Of the level at which a pump is started or stopped: a controller compares, and no water moves in between."""


def right_ways(block: Block) -> Ways:
    """What a right model may have wrong in a block."""
    return RIGHT_AT_EVENTS if block.signal in {START_LEVEL, STOP_LEVEL} else RIGHT


class Seen:
    """What the residuals of a block show of what is wrong in it, whatever ways there are.

    Parameters
    ----------
    block : Block
    residuals : (k,) array
    form : Form
        Of the block's cells.
    swing : float
        Of `SWINGS`.
    """

    def __init__(self, block: Block, residuals: Floats, form: Form, swing: float) -> None:
        self.block, self.residuals, self.form, self.swing = block, residuals, form, swing
        counts = block.group_sums(np.ones(residuals.size))
        self._allowed, self._signature, self._late = (
            block.group_sums(one**2) / counts for one in (block.allowed, form.signature, form.late)
        )
        self._fixed = block.group_means(form.fixed)
        self._spans = np.bincount(block.span)
        self._scattered: dict[tuple[Way, ...], tuple[Integers, float, Floats, Floats]] = {}

    def likeliest(self, ways: Ways) -> list[tuple[float, Allowance]]:
        """What may be wrong, most probably, by the means of groups and their scatter over the cycles.

        A cell counts by its variance in both: what moves much from cycle to cycle says little of what all have alike.

        Parameters
        ----------
        ways : Ways

        Returns
        -------
        found : list of (float, Allowance)
            What not knowing the ways adds to the logarithm of the probability, and what those that were chosen allow;
            the second, if there is one, where all spans are poor.
        """
        span_of, spans = self.block.span, self._spans
        changing, log_prior, mean, of_mean = self._changing(tuple(ways.changing))
        own_variances = self._variances(ways.own)
        apart = of_mean + (LATE[2] ** 2) * self._late + own_variances
        weight = 1.0 / (of_mean + own_variances[-1])
        middle = np.bincount(span_of, weight * mean) / np.bincount(span_of, weight)
        freedom = (1.0 - 1.0 / spans)[span_of]
        away = (mean - middle[span_of]) ** 2
        own, prior = _chosen(-0.5 * (freedom * np.log(apart) + away / apart), ways.own)
        log_prior += prior

        left = np.bincount(span_of, _picked(apart, own)) / spans**2 + np.bincount(span_of, self._late) / spans
        alike = left + np.array([np.bincount(span_of, one) / spans for one in self._variances(ways.span)])
        span, prior = _chosen(-0.5 * (np.log(alike) + middle**2 / alike), ways.span)
        chosen = [(log_prior + prior, span)]
        if ways.may_be_prone and not span.all():
            prone = np.log(POORLY) + spans.size * np.log1p(-POORLY)
            chosen.append((log_prior + prone, np.ones_like(span)))
        return [
            (
                log,
                Allowance(
                    span=_errors(ways.span, of_span[span_of]),
                    own=_errors(ways.own, own),
                    changing=_errors(ways.changing, changing[self.block.group]),
                    swing=self.swing,
                ),
            )
            for log, of_span in chosen
        ]

    def _changing(self, ways: tuple[Way, ...]) -> tuple[Integers, float, Floats, Floats]:
        """What changes between cycles in each group, what not knowing it adds, and means with their variances."""
        if ways not in self._scattered:
            precision, means, logs = self._weighed(
                np.array([one.errors.offset for one in ways]), np.array([one.errors.form for one in ways])
            )
            changing, log_prior = _chosen(logs, ways)
            mean, of_mean = _picked(means, changing), 1.0 / _picked(precision, changing)
            self._scattered[ways] = changing, log_prior, mean, of_mean
        return self._scattered[ways]

    def _weighed(self, offsets: Floats, forms: Floats) -> tuple[Floats, Floats, Floats]:
        """(ways, groups) precision of means, the means, and logarithms of the ways in which cycles may differ."""
        block, form = self.block, self.form
        moved = block.surge * block.of_inflow + (self.swing * form.swinging) ** 2
        moved = np.add(moved, (offsets[:, None] * block.allowed) ** 2)
        alone = block.variance + np.square([of_form(one, form.fixed) * form.signature for one in forms])
        precision, means, logs = np.zeros((3, offsets.size, self._fixed.size))
        scatter_of(self.residuals, alone + moved, block.group, precision, means, logs)
        settled(
            self.residuals - means[:, block.group],
            alone + 0.5 * moved,
            np.sqrt(0.5 * moved),
            precision,
            np.argsort(block.group, kind="stable"),
            np.r_[0, np.cumsum(np.bincount(block.group))],
            block.cycle,
            np.zeros((2, int(block.cycle.max()) + 1)),
            np.vstack([np.argmax(logs, axis=0), np.tile(np.arange(offsets.size)[:, None], self._fixed.size)]),
            logs,
        )
        return precision, means, logs

    def _variances(self, ways: Sequence[Way]) -> Floats:
        """(ways, groups) variances of what groups may be off."""
        return np.array(
            [
                one.errors.offset**2 * self._allowed + of_form(one.errors.form, self._fixed) ** 2 * self._signature
                for one in ways
            ]
        )


def _chosen(logs: Floats, ways: Sequence[Way]) -> tuple[Integers, float]:
    """(n,) likeliest of the ways by their (ways, n) logarithms, and what not knowing them adds to the logarithm.

    That is the sum over all ways, each with its probability, over the likeliest: ways that say the same cost nothing.
    A block is prone to be poor with the probability with which one of its members is where it is not.
    """
    poor = np.array([way.is_poor for way in ways])
    if poor.all():
        return np.argmax(logs, axis=0), 0.0
    tried = []
    for share, log_prone in ((POORLY, np.log(1.0 - POORLY)), (1.0 - POORLY, np.log(POORLY))):
        log_priors = np.log(np.where(poor, share / poor.sum(), (1.0 - share) / (~poor).sum()))
        joint = logs + log_priors[:, None]
        tried.append((float(np.logaddexp.reduce(joint, axis=0).sum()) + log_prone, np.argmax(joint, axis=0)))
    _, best = max(tried, key=lambda one: one[0])
    return best, float(np.logaddexp.reduce([total for total, _ in tried]) - _picked(logs, best).sum())


def _picked(values: Floats, chosen: Integers) -> Floats:
    """(n,) of (ways, n) values."""
    return values[chosen, np.arange(chosen.size)]


def _errors(ways: Sequence[Way], chosen: Integers) -> Errors:
    return Errors(
        offset=np.array([way.errors.offset for way in ways])[chosen],
        form=np.array([way.errors.form for way in ways])[chosen],
    )
