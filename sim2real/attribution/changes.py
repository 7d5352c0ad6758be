"""Effects whose strength may differ from one recording to the next, tried beside those that stay as they are."""

from collections.abc import Sequence

import numpy as np

from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.trials import Each
from wetwell.simulator.effects import EFFECTS

MOST_CHANGED = 4
"""Single effects that are tried so, those that explain most first."""


def changed(fitter: Fitter, fits: Sequence[Fit], each: Each) -> list[Fit]:
    """Fits once more, with a strength for each period of those effects that wear, grow or drift.

    Parameters
    ----------
    fitter : Fitter
    fits : sequence of Fit
    each : callable
        Fits them, perhaps side by side.

    Returns
    -------
    fits : list of Fit
        Those that have such an effect; none of a single period.
    """
    periods = fitter.periods
    if periods < 2:
        return []
    started = [begun for fit in fits if (begun := _begun(fitter, fit, periods)) is not None]
    return list(each(fitter.refine, started))


def _begun(fitter: Fitter, fit: Fit, periods: int) -> Fit | None:
    """The fit with the same strength in each period, where one may change."""
    may_change = [EFFECTS[one.name].may_change and one.periods == 1 for one in fit.candidates]
    if not any(may_change):
        return None
    candidates = tuple(
        one.changing(periods) if changes else one for one, changes in zip(fit.candidates, may_change, strict=True)
    )
    points = []
    for one, point, changes in zip(fit.candidates, fit.points, may_change, strict=True):
        counts = [periods if changes and free.neutral is not None else 1 for free in one.free]
        points.append(np.repeat(point, counts))
    return fitter.at(candidates, points)
