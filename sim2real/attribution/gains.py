"""What fits gain on the cycles of the validation, and whether that is worth a name."""

from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.attribution.significance import is_significant
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.residuals.bins import MIN_BINS, SIGNALS, Bins
from wetwell.sim2real.residuals.groups import groups_of
from wetwell.sim2real.residuals.structure import phase

CELL_GAIN = 0.2
"""Gain in mean square of a cell, in units of noise, under which a gap is not worth a name."""
FURTHER_CELL_GAIN = 0.5
"""Gain in mean square of a cell under which a further effect is not: the form of the first leaves as much."""
SPAN_GAIN = 1.0
"""Gain in mean square of a span after switching that is enough for the first effect: a second or two a start."""
LEAST_COUNT = 10
"""Bins without which a cell or a span shows no gain."""
LEAST_GAIN = 200.0
"""Drop of the sum of squares that a right model may make, however much there is to compare."""
LEAST_BY_CHANCE = 40.0
"""Drop that the library makes of white noise: χ² of four parameters passes it once in ten million fits."""
PRICE = 0.006
"""Share of the best gain that each free parameter costs: of two equal explanations the simpler is taken."""
KEPT = 1.0 / 3.0
"""Share of its gap that a signal may keep under the accepted effects."""
WORTH = 1.5
"""Mean square of a cell beyond noise, in units of it, for which a further effect is looked for in any case."""
QUIET = 0.3
"""Mean square of a signal beyond noise, in units of it, under which the signal shows no gap."""
UNDONE_SHARE = 0.25
"""Share of the whole gap that one effect may make in quiet signals for another to undo."""
JOIN_SHARE = 0.06
"""Least gain of a further effect, as a share of what the first explains, which its form may leave."""
CHANCE = 4.0
"""Standard deviations of a sum of squares that noise does not reach."""
OWN_SHARE = 0.002
"""Least gain of a further effect beyond `JOIN_SHARE` of each span, as a share of what the first explains in all."""
CLASS_SHARE = 0.02
"""Explanations within this share of the best gain are equivalent."""
NOISY_SHARE = 0.06
"""Share of the best gain within which they are where the cycles do not agree which is better."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RankedFit:
    """A fit and its gain on the cycles it was not fitted on: in all, and priced for its parameters."""

    fit: Fit
    gain: float
    score: float
    by_cycle: Floats

    def is_matched_by(self, rival: "RankedFit", best_gain: float) -> bool:
        """Whether a rival explains as much but for a small share, or for a larger one that may be chance."""
        behind = self.by_cycle - rival.by_cycle
        lost = float(behind.sum())
        return lost <= CLASS_SHARE * best_gain or (lost <= NOISY_SHARE * best_gain and not is_significant(behind))


class Gains:
    """Gains over the plain residuals.

    Parameters
    ----------
    plain : (bins,) array
        Residuals without any effect.
    bins : Bins
    rows : (bins,) array
        Those of the validation.
    """

    def __init__(self, plain: Floats, bins: Bins, rows: Flags) -> None:
        self.plain = plain
        self._floor = bins.floor
        self._rows = rows
        self._least = least_gain(bins, rows)
        cell = bins.signal * len(REGIMES) + bins.regime
        self._cells = groups_of(cell, rows, len(SIGNALS) * len(REGIMES))
        self._spans = groups_of(cell * 32 + phase(bins), rows)
        self._signals = groups_of(bins.signal, rows, len(SIGNALS))
        self._cycles = groups_of(bins.cycle, rows)

    def of(self, fit: Fit | None) -> float:
        """Drop of the sum of squares by a fit; 0 for none."""
        return 0.0 if fit is None else max(float(np.sum((self.plain**2 - fit.residuals**2)[self._rows])), 0.0)

    def ranked(self, fit: Fit, before: Floats | None = None) -> RankedFit:
        """A fit with its gain over other residuals than the plain ones, where there are any."""
        gains = (self.plain if before is None else before) ** 2 - fit.residuals**2
        gain = float(gains[self._rows].sum())
        return RankedFit(fit=fit, gain=gain, score=gain, by_cycle=self._cycles.sums(gains))

    def is_real(self, ranked: RankedFit, before: Floats, cell_gain: float, span_gain: float) -> bool:
        """Whether a gain over these residuals is beyond chance, and worth a name in some cell or span."""
        if not is_significant(ranked.by_cycle) or ranked.gain < self._least:
            return False
        gains = before**2 - ranked.fit.residuals**2
        return any(
            float(np.max(groups.means(gains)[groups.counts >= LEAST_COUNT], initial=0.0)) > least
            for groups, least in ((self._cells, cell_gain), (self._spans, span_gain))
        )

    def is_own(self, gains: Floats, first: RankedFit) -> bool:
        """Whether there is more in some spans than the form of the first effect may have left there, or chance."""
        spans = self._spans
        own = spans.sums(gains) - JOIN_SHARE * np.maximum(spans.sums(self.plain**2 - first.fit.residuals**2), 0.0)
        own = own[own > CHANCE * np.sqrt(2.0 * spans.counts)]
        return float(own.sum()) > max(OWN_SHARE * first.gain, self._least)

    def is_worth_more(self, left: Floats, current: Fit, first: RankedFit) -> bool:
        """Whether a further effect could gain enough on what is left."""
        is_little = float((left**2 - self._floor)[self._rows].sum()) < JOIN_SHARE * first.gain
        return (
            not is_little or bool(self.open_signals(left)) or self.is_own(current.residuals**2 - self._floor, first)
        )

    def open_signals(self, left: Floats) -> set[int]:
        """Signals that keep more than a third of their gap, and a gap that is worth a name."""
        excess = left**2 - self._floor
        is_large = (self._cells.counts >= MIN_BINS) & (self._cells.means(excess) > WORTH)
        is_worth = np.any(is_large.reshape(len(SIGNALS), -1), axis=1)
        was = self._signals.sums(self.plain**2 - self._floor)
        return set(np.flatnonzero(is_worth & (self._signals.sums(excess) > KEPT * was)).tolist())

    def is_undone(self, fewer: Fit) -> bool:
        """Whether a fit without one of its effects has a gap in signals that show none: the one undid the others."""
        plain = self._signals.sums(self.plain**2 - self._floor)
        is_quiet = plain < QUIET * self._signals.counts
        undone = (self._signals.sums(fewer.residuals**2 - self._floor) - plain)[is_quiet]
        return float(np.maximum(undone, 0.0).sum()) > UNDONE_SHARE * float(np.maximum(plain, 0.0).sum())


def least_gain(bins: Bins, rows: Flags) -> float:
    """Drop of the sum of squares of some bins that a right model may make: by its tolerance, or by chance."""
    return min(LEAST_GAIN, max(LEAST_BY_CHANCE, float(np.sum(bins.tolerance[rows] ** 2))))


def penalise(ranked: list[RankedFit], known: float = 0.0) -> list[RankedFit]:
    """Ranked by gain less the price of the free parameters; the best variant of each combination of names.

    The price is a share of what the best one gains over what is `known`.
    """
    most = max((r.gain - known for r in ranked), default=0.0)
    priced = [replace(r, score=r.gain - PRICE * most * r.fit.free) for r in ranked]
    best: dict[tuple[str, ...], RankedFit] = {}
    for r in sorted(priced, key=lambda r: -r.score):
        best.setdefault(tuple(sorted(r.fit.names)), r)
    return list(best.values())
