"""Which effects of the library explain the gap: fitted on half of the cycles, weighed on all of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.hypotheses import Hypotheses
from wetwell.sim2real.attribution.initial_guess import initial_guesses
from wetwell.sim2real.attribution.intervals import are_sized, informed, intervals_of, sharpened
from wetwell.sim2real.attribution.possible import PossibleSet, possible_sets
from wetwell.sim2real.attribution.search import MOST_CHANGED, Search, changed, completed, in_order
from wetwell.sim2real.attribution.testable import NotTested, shown_by
from wetwell.sim2real.attribution.trials import Each, Trials
from wetwell.sim2real.attribution.unnamed import unnamed_beside
from wetwell.sim2real.attribution.weighing.hypothesis import Hypothesis
from wetwell.sim2real.likelihood.cells import Cells, cells_of
from wetwell.sim2real.likelihood.falls import Falls, falls_at_rest
from wetwell.sim2real.likelihood.jumps import with_jumps
from wetwell.sim2real.likelihood.posterior import (
    SetProbability,
    UnknownShare,
    best_set,
    equivalents,
    posterior_of,
    shared,
    unknown_shares,
    verdict_of,
)
from wetwell.sim2real.likelihood.priors import EVEN, Priors
from wetwell.sim2real.recording.regimes import MULTI_PUMP, Regimes
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import residuals_of
from wetwell.sim2real.residuals.bins import TELEMETRY, Bins
from wetwell.sim2real.residuals.conditions import conditions_of
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import EFFECTS


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribution:
    """Outcome: residuals, the accepted fit, and the single effects.

    Attributes
    ----------
    plain : (bins,) array
        Residuals without any effect, as `asinh_loss` makes them; so are all others.
    accepted : Fit or None
        The most probable set where effects are the verdict; the effect first without which most is left. What each
        real station has, and is too small to be told, comes after those that are told.
    equivalent : dict of tuple of str
        Effects that may be in the place of each one that is told.
    ends : (parameters, 2) array
        Of the 95 % intervals of the accepted points, in the order of the candidates.
    own, own_ends : Fit or None, (parameters, 2) array
        The same by this recording alone, without what was known of its parameters before.
    singles : tuple of Fit
        Single candidates, the one that explains most first.
    training, validation : (bins,) array
        Bins that are fitted, and those on which gaps are measured.
    posterior : tuple of SetProbability
        Best first.
    unknown : tuple of UnknownShare
        Ways in which something unknown may act, if it does.
    possible : tuple of PossibleSet
        Sets that may be the truth, as they were fitted.
    not_tested : tuple of NotTested
        Candidates that the recording cannot show.
    beside : (bins,) array
        Residuals beside the companions of the likeliest way in which something unknown acts.
    falls : Falls or None
        Of the level at rest.
    """

    plain: Floats
    accepted: Fit | None
    equivalent: dict[str, tuple[str, ...]]
    ends: Floats
    own: Fit | None
    own_ends: Floats
    singles: tuple[Fit, ...]
    training: Flags
    validation: Flags
    posterior: tuple[SetProbability, ...]
    unknown: tuple[UnknownShare, ...]
    possible: tuple[PossibleSet, ...]
    beside: Floats
    not_tested: tuple[NotTested, ...] = ()
    falls: Falls | None = None

    @property
    def after(self) -> Floats:
        """(bins,) residuals under the accepted effects; the plain ones where there are none."""
        return self.plain if self.accepted is None else self.accepted.residuals


def attribute(
    replay: Replay,
    residuals: StationResiduals,
    regimes: Regimes,
    candidates: Sequence[Candidate],
    progress: Callable[[float], None] = lambda _: None,
    each: Each = map,
    priors: Priors = EVEN,
) -> Attribution:
    """Search the library for what explains a recording.

    Parameters
    ----------
    replay : Replay
    residuals : StationResiduals
    regimes : Regimes
    candidates : sequence of Candidate
    progress : callable
        Gets the share of the work that is done, 0 to 1.
    each : callable
        Tries candidates, perhaps side by side: the replay holds no lock.
    priors : Priors
        How usual effects are, and how large.
    """
    training, validation = halves(residuals.bins, replay.traces.pumps)
    fitter = Fitter(replay, residuals, training)
    plain = fitter.plain.residuals
    may_be_told = [one for one in candidates if EFFECTS[one.name].is_told]
    tested, not_tested = shown_by(may_be_told, fitter, replay, regimes, each)
    beside = [one for one in candidates if one.is_of_all and (one in tested or one not in may_be_told)]
    guesses = {candidate: initial_guesses(candidate, replay, residuals, plain) for candidate in tested}
    cells = weighed_cells(replay, residuals, residuals_of(plain))
    trials = Trials(fitter, cells, guesses, progress, each)
    singles = trials.singles()
    names = {candidate.name for candidate in tested}
    named = (TELEMETRY,) if residuals.telemetry.effects <= names else ()
    falls = falls_at_rest(replay.traces, replay.station, regimes, residuals.telemetry.patterns)
    hypotheses = Hypotheses(fitter, cells, each, named, falls)
    hypotheses.add(singles)
    hypotheses.add(changed(fitter, singles[:MOST_CHANGED], each))
    Search(fitter, trials, hypotheses).run()
    hypotheses.add(changed(fitter, [hypotheses.possible[0].fit], each))
    hypotheses.add_unnamed(unnamed_beside(replay, residuals, fitter, hypotheses.weighed[0].fit, names, each))
    hypotheses.settle()
    unnamed = hypotheses.unnamed_weights()
    log_share = partial(priors.log_share, tested=[fit.names[0] for fit in singles])

    def weighed() -> tuple[SetProbability, ...]:
        return posterior_of(hypotheses.weights(), len(singles), log_share, unnamed)

    def ends_of(one: Hypothesis) -> Floats:
        return sharpened(one.fit, intervals_of(fitter, one.fit, residuals.bins), one.evidence)

    while verdict_of(posterior := weighed()) == "effect":
        told = best_set(posterior, hypotheses.alike)
        likely, telling = hypotheses.of(told), hypotheses.telling(told)
        fit = completed(fitter, likely.fit, beside)
        whole = likely if fit is likely.fit else hypotheses.scales.weigh(fit)
        if {*told} <= {*whole.told} and are_sized(telling.fit, its_ends := ends_of(telling), told):
            own_ends = its_ends if whole is telling else ends_of(whole)
            if {*whole.told} != {*told} or not are_sized(whole.fit, own_ends, told):
                whole, own_ends = likely, its_ends if likely is telling else ends_of(likely)
            own = whole.fit
            break
        hypotheses.rule_out(told)
    else:
        told, own, own_ends = (), None, np.zeros((0, 2))
    posterior = shared(posterior, hypotheses.alike)
    accepted, ends = None, own_ends
    if own is not None:
        own, own_ends = in_order(fitter, own, own_ends, told, posterior)
        accepted, ends = informed(fitter, own, priors), own_ends
    unknown = unknown_shares(hypotheses.weights(), len(singles), log_share, unnamed)
    progress(1.0)
    if accepted is not None and accepted is not own:
        ends = intervals_of(fitter, accepted, residuals.bins, priors)
    return Attribution(
        plain=plain,
        accepted=accepted,
        equivalent=equivalents(posterior, told),
        ends=ends,
        own=own,
        own_ends=own_ends,
        singles=tuple(singles),
        training=training,
        validation=validation,
        posterior=posterior,
        unknown=unknown,
        possible=possible_sets(hypotheses, posterior),
        beside=hypotheses.companions(max(unknown, key=lambda way: way.share).acting).residuals,
        not_tested=not_tested,
        falls=falls,
    )


def weighed_cells(replay: Replay, residuals: StationResiduals, plain: Floats) -> Cells:
    """Cells of all bins, and how an inflow that nobody measures jumps.

    What telemetry rounds or holds of a level is no error: such a level has hardly any at rest, and some in runs. So
    its rests say nothing of jumps.

    Parameters
    ----------
    replay : Replay
    residuals : StationResiduals
    plain : (bins,) array
        Without any effect.
    """
    bins, traces = residuals.bins, replay.traces
    condition, has_inflow = conditions_of(bins, traces, replay.station), traces.inflow_m3h is not None
    cells = cells_of(bins, condition, has_inflow=has_inflow, is_each_second=traces.is_each_second)
    is_coarse = any(pattern.quantity == "level_m" for pattern in residuals.telemetry.patterns)
    return cells if is_coarse else with_jumps(cells, bins, plain)


def halves(bins: Bins, pumps: int) -> tuple[Flags, Flags]:
    """Bins to fit and to judge: cycles alternate, as many at a time as there are pumps, so that each pump is in both.

    Cycles with several pumps at once are few: they alternate one by one.
    """
    cycles, of_bin = np.unique(bins.cycle, return_inverse=True)
    is_multi = np.bincount(of_bin, bins.regime == MULTI_PUMP) > 0.0
    first = (cycles // pumps) % 2 == 0
    first[is_multi] = np.arange(int(is_multi.sum())) % 2 == 0
    return first[of_bin], ~first[of_bin]
