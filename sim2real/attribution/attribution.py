"""Which effects of the library explain the gap: fitted on half of the cycles, ranked on the other half."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.gains import CELL_GAIN, SPAN_GAIN, Gains, RankedFit
from wetwell.sim2real.attribution.initial_guess import initial_guesses
from wetwell.sim2real.attribution.intervals import intervals_of
from wetwell.sim2real.attribution.search import Search
from wetwell.sim2real.attribution.testable import NotTested, shown_by
from wetwell.sim2real.attribution.trials import Each, Trials
from wetwell.sim2real.recording.regimes import MULTI_PUMP, Regimes
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import Bins
from wetwell.sim2real.residuals.station import StationResiduals


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribution:
    """Outcome: residuals, the accepted fit, and the single effects.

    Attributes
    ----------
    plain : (bins,) array
        Residuals without any effect, as `asinh_loss` makes them; so are all others.
    accepted : Fit or None
        None where no effect explains the gap.
    left : (bins,) array
        Residuals under the accepted effects; where values of each second cannot show one of these, or none is
        accepted, with short transients in ramps excused.
    equivalent : tuple of tuple of str
        Effects that explain as much in the place of each accepted one.
    ends : (parameters, 2) array
        Of the 95 % intervals of the accepted points, in the order of the candidates.
    singles : tuple of RankedFit
        Single candidates by score.
    training, validation : (bins,) array
        Bins that are fitted, and those on which gains and gaps are measured.
    not_tested : tuple of NotTested
        Candidates that the recording cannot show.
    """

    plain: Floats
    accepted: Fit | None
    left: Floats
    equivalent: tuple[tuple[str, ...], ...]
    ends: Floats
    singles: tuple[RankedFit, ...]
    training: Flags
    validation: Flags
    not_tested: tuple[NotTested, ...] = ()

    @property
    def after(self) -> Floats:
        """(bins,) residuals under the accepted effects, nothing excused; the plain ones where there are none."""
        return self.plain if self.accepted is None else self.accepted.residuals


def attribute(
    replay: Replay,
    residuals: StationResiduals,
    regimes: Regimes,
    candidates: Sequence[Candidate],
    progress: Callable[[float], None] = lambda _: None,
    each: Each = map,
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
    """
    training, validation = halves(residuals.bins, replay.traces.pumps)
    fitter = Fitter(replay, residuals, training)
    plain = fitter.plain.residuals
    gains = Gains(plain, residuals.bins, validation)
    tested, not_tested = shown_by(candidates, fitter, (training, validation), replay, regimes, each)
    guesses = {candidate: initial_guesses(candidate, replay, residuals, plain) for candidate in tested}
    trials = Trials(fitter, gains, guesses, progress, each)
    singles = trials.singles()
    accepted: Fit | None = None
    equivalent: tuple[tuple[str, ...], ...] = ()
    if singles and gains.is_real(singles[0], plain, CELL_GAIN, SPAN_GAIN):
        search = Search(fitter, gains, trials, singles)
        final = search.accepted()
        accepted, equivalent = final.fit, search.equivalent(final)
    progress(1.0)
    return Attribution(
        plain=plain,
        accepted=accepted,
        left=fitter.left(accepted),
        equivalent=equivalent,
        ends=np.zeros((0, 2)) if accepted is None else intervals_of(fitter, accepted, residuals.bins),
        singles=tuple(singles),
        training=training,
        validation=validation,
        not_tested=not_tested,
    )


def halves(bins: Bins, pumps: int) -> tuple[Flags, Flags]:
    """Bins to fit and to judge: cycles alternate, as many at a time as there are pumps, so that each pump is in both.

    Cycles with several pumps at once are few: they alternate one by one.
    """
    cycles, of_bin = np.unique(bins.cycle, return_inverse=True)
    is_multi = np.bincount(of_bin, bins.regime == MULTI_PUMP) > 0.0
    first = (cycles // pumps) % 2 == 0
    first[is_multi] = np.arange(int(is_multi.sum())) % 2 == 0
    return first[of_bin], ~first[of_bin]
