"""What an attribution comes to in a report: accepted effects, the ranking of single ones, the cells of the gap."""

from collections.abc import Mapping

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.attribution.attribution import Attribution
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.diagnosis.report import FittedParameter, FoundEffect, NoiseCheck, RankedCandidate, Where
from wetwell.sim2real.diagnosis.shrinkage import cell_gap, gap_of
from wetwell.sim2real.likelihood.cells import cells_of
from wetwell.sim2real.likelihood.covariance import expected_squares
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.residuals.asinh_loss import residuals_of, squares_of
from wetwell.sim2real.residuals.bins import SIGNALS, Bins
from wetwell.simulator.effects.effect import Component


def found_effects(fit: Fit | None, ends: Floats, like: Mapping[str, tuple[str, ...]]) -> tuple[FoundEffect, ...]:
    """Effects of a fit with their parameters, those that are told first.

    Parameters
    ----------
    fit : Fit or None
        None has no effects.
    ends : (parameters, 2) array
        Of the intervals of its points.
    like : mapping of tuple of str
        What may be in the place of each effect that is told.
    """
    if fit is None:
        return ()
    parted = np.split(ends, np.cumsum([point.size for point in fit.points])[:-1])
    return tuple(
        FoundEffect(
            name=candidate.name,
            component=candidate.component,
            equivalent=like.get(candidate.name, ()),
            differs=tuple(dict.fromkeys(free.name.partition("@")[0] for free in candidate.free if "@" in free.name)),
            parameters=_parameters(candidate, point, interval),
        )
        for candidate, point, interval in zip(fit.candidates, fit.points, parted, strict=True)
    )


def _parameters(candidate: Candidate, point: Floats, ends: Floats) -> dict[str, FittedParameter]:
    """What is fixed first, then what was fitted; of what differs between periods the last one has the plain name."""
    last = f"@{candidate.periods}"
    fixed = {name: FittedParameter(value=value, ci=None, unit="") for name, value in candidate.fixed}
    return fixed | {
        free.name.removesuffix(last): FittedParameter(
            value=free.value(float(one)), ci=(free.value(float(low)), free.value(float(high))), unit=free.unit
        )
        for free, one, (low, high) in zip(candidate.free, point, ends, strict=True)
    }


def ranking(found: Attribution, bins: Bins, rng: np.random.Generator) -> tuple[RankedCandidate, ...]:
    """Single effects, best first, with the drop of the sum of squares and the shrinkage by each alone."""
    rows, ranked = found.validation, []
    for fit in found.singles:
        gap = gap_of(found.plain, fit.residuals, bins, rows, rng)
        score = float(np.sum((found.plain**2 - fit.residuals**2)[rows]))
        ranked.append(
            RankedCandidate(name=fit.names[0], score=score, shrinkage=gap.shrinkage, shrinkage_ci=gap.shrinkage_ci)
        )
    return tuple(sorted(ranked, key=lambda one: -one.score))


def noise_check(found: Attribution, bins: Bins, condition: Integers) -> tuple[NoiseCheck, ...]:
    """Whether what is left under the answer is as large as noise and a right model make it, by signal and regime."""
    cells = cells_of(bins, condition, has_inflow=True, is_each_second=True)
    left = cells.means(residuals_of(found.after))
    checks = []
    for block in cells.blocks:
        expected = expected_squares(block)
        checks.append(
            NoiseCheck(
                signal=SIGNALS[block.signal],
                regime=REGIMES[block.regime],
                mean_square=float(np.mean(left[block.rows] ** 2 / expected)),
                noise_share=float(np.mean(block.variance / expected)),
            )
        )
    return tuple(checks)


def where_it_lies(
    found: Attribution, bins: Bins, excess: Floats, component: Component, rng: np.random.Generator
) -> tuple[Where, ...]:
    """Cells of the gap, the largest first.

    Parameters
    ----------
    excess : (bins,) array
        What of each square the gap is made of.
    component : Component
        The one held responsible.
    """
    beyond_noise = squares_of(found.plain) - bins.floor
    total = float(np.maximum(np.bincount(bins.signal * len(REGIMES) + bins.regime, excess), 0.0).sum())
    places: list[tuple[float, Where]] = []
    for signal, regime, cell in bins.cells(found.validation):
        share = float(excess[cell].sum()) / max(total, 1e-12)
        if share <= 0.0:
            continue
        gap, ci = cell_gap(beyond_noise, bins, cell, rng)
        place = Where(
            component=component, signal=SIGNALS[signal], regime=REGIMES[regime], gap=gap, ci=ci, share=share
        )
        places.append((share, place))
    return tuple(place for _, place in sorted(places, key=lambda pair: -pair[0]))
