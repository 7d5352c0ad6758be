"""How large a gap is on the cycles of the validation, and how far an effect shrinks it."""

from collections.abc import Callable

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.diagnosis.report import Gap, SignalGap
from wetwell.sim2real.diagnosis.report_part import Interval
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.residuals.asinh_loss import squares_of
from wetwell.sim2real.residuals.bins import SIGNALS, Bins, allowed_size
from wetwell.sim2real.residuals.groups import groups_of

FLOOR = 1.0
RESAMPLES = 200
CONFIDENCE = 0.95
NOTHING = 0.02
"""Gap over the floor under which there is nothing to shrink."""


def gap_of(before: Floats, after: Floats, bins: Bins, rows: Flags, rng: np.random.Generator) -> Gap:
    r"""Gap before and after on some bins, in units of noise, bootstrapped over whole cycles; a perfect model has 1.

    $$g = \sqrt{1 + \overline{z^2 - z_0^2}}, \qquad
    s = \frac{g_\text{before} - g_\text{after}}{g_\text{before} - 1}$$

    with the mean over bins of each signal, then over signals, and $z_0^2$ the mean square of noise alone.

    Parameters
    ----------
    before, after : (bins,) array
        As `asinh_loss` makes them.
    """
    signals, sums = _sums_of(before, after, bins, rows)
    each, whole = _gaps(sums)
    return Gap(
        before=float(whole[0]),
        after=float(whole[1]),
        floor=FLOOR,
        shrinkage=shrinkage(float(whole[0]), float(whole[1])),
        shrinkage_ci=_interval(lambda drawn: shrinkage(*_gaps(sums[:, :, drawn])[1]), sums.shape[2], rng),
        by_signal={
            SIGNALS[signal]: SignalGap(before=float(each[0, k]), after=float(each[1, k]))
            for k, signal in enumerate(signals)
        },
    )


def gaps_of(before: Floats, after: Floats, bins: Bins, rows: Flags) -> tuple[float, float]:
    """Gap before and after as of `gap_of`, unrounded and without interval."""
    _, (whole_before, whole_after) = _gaps(_sums_of(before, after, bins, rows)[1])
    return float(whole_before), float(whole_after)


def shrinkage(before: float, after: float) -> float:
    """Share of the gap over the floor that is gone; 0 without a gap to shrink."""
    return (before - after) / (before - FLOOR) if before - FLOOR > NOTHING else 0.0


def excess_that_matters(residuals: Floats, rows: Flags, bins: Bins) -> Floats:
    """(bins,) what of the squares is beyond noise, in each cell that departs by more than is allowed, if any does.

    A cell is a signal of a pump in a regime. Thousands of seconds of ramps that are off by less than is allowed would
    outweigh a stop level that is off by ten times of that.

    Parameters
    ----------
    residuals : (bins,) array
        As `asinh_loss` makes them.
    rows : (bins,) array
        That count; 0 elsewhere.
    bins : Bins
    """
    cells = groups_of((bins.signal * len(REGIMES) + bins.regime) * 64 + bins.pump + 1, rows)
    square = residuals**2
    allowed = allowed_size(bins.material, bins.floor) ** 2
    matters = cells.means(square - bins.floor) > cells.means(allowed)
    excess = np.zeros(bins.size)
    excess[rows] = np.where(matters[cells.number] | ~matters.any(), (square - bins.floor)[rows], 0.0)
    return excess


def cell_gap(excess: Floats, bins: Bins, cell: Flags, rng: np.random.Generator) -> tuple[float, Interval]:
    """Gap of one cell from what its squares are over noise, with an interval over whole cycles."""
    cycles = groups_of(bins.cycle, cell)
    sums, counts = cycles.sums(excess), cycles.counts

    def gap(drawn: Integers) -> float:
        return float(np.sqrt(FLOOR + max(sums[drawn].sum() / counts[drawn].sum(), 0.0)))

    return gap(np.arange(sums.size)), _interval(gap, sums.size, rng)


def _interval(figure: Callable[[Integers], float], cycles: int, rng: np.random.Generator) -> Interval:
    """Interval of a figure of cycles that are drawn with replacement."""
    drawn = [figure(rng.integers(0, cycles, cycles)) for _ in range(RESAMPLES)]
    low, high = np.quantile(drawn, [(1.0 - CONFIDENCE) / 2.0, (1.0 + CONFIDENCE) / 2.0])
    return float(low), float(high)


def _sums_of(before: Floats, after: Floats, bins: Bins, rows: Flags) -> tuple[list[int], Floats]:
    """Signals, and (3, signals, cycles) sums of what is beyond noise before and after, and of bins."""
    signals = [signal for signal in range(len(SIGNALS)) if np.any(rows & (bins.signal == signal))]
    cycles, of_bin = np.unique(bins.cycle[rows], return_inverse=True)
    excess = [(squares_of(losses) - bins.floor)[rows] for losses in (before, after)]
    sums = np.zeros((3, len(signals), cycles.size))
    for k, signal in enumerate(signals):
        own = bins.signal[rows] == signal
        for row, weights in enumerate((*excess, None)):
            sums[row, k] = np.bincount(of_bin[own], None if weights is None else weights[own], cycles.size)
    return signals, sums


def _gaps(sums: Floats) -> tuple[Floats, Floats]:
    """(2, signals) gaps before and after of each signal, and (2,) of all."""
    total = sums.sum(axis=2)
    mean = np.maximum(total[:2] / np.maximum(total[2], 1.0), 0.0)
    return np.sqrt(FLOOR + mean), np.sqrt(FLOOR + mean.mean(axis=1))
