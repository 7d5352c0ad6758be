"""How large a gap is on held-out cycles, and how far an effect shrinks it."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.residuals.bins import SIGNALS, Bins
from wetwell.sim2real.residuals.residuals import SOFT

Interval = tuple[float, float]

FLOOR = 1.0
DRAWN = 200
CONFIDENCE = 0.95
NOTHING = 0.02
"""Gap over the floor under which there is nothing to shrink."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shrinkage:
    r"""Gap before and after, in units of noise; a perfect model has 1.

    $$g = \sqrt{1 + \overline{z^2 - z_0^2}}, \qquad
    s = \frac{g_\text{before} - g_\text{after}}{g_\text{before} - 1}$$

    with the mean over bins of each signal, then over signals, and $z_0^2$ the mean square of noise alone.
    """

    before: float
    after: float
    shrinkage: float
    shrinkage_ci: Interval
    by_signal: dict[str, tuple[float, float]]


def shrinkage_of(before: Floats, after: Floats, bins: Bins, held: Flags, rng: np.random.Generator) -> Shrinkage:
    """Gap before and after on the held-out bins, from soft residuals, with a bootstrap over whole cycles."""
    signals, sums = _sums_of(before, after, bins, held)
    cycles = sums.shape[2]
    each, (whole_before, whole_after) = _gaps(sums)
    drawn = [_share(*_gaps(sums[:, :, rng.integers(0, cycles, cycles)])[1]) for _ in range(DRAWN)]
    low, high = np.quantile(drawn, [(1.0 - CONFIDENCE) / 2.0, (1.0 + CONFIDENCE) / 2.0])
    return Shrinkage(
        before=float(whole_before),
        after=float(whole_after),
        shrinkage=_share(float(whole_before), float(whole_after)),
        shrinkage_ci=(float(low), float(high)),
        by_signal={SIGNALS[s]: (float(each[0, k]), float(each[1, k])) for k, s in enumerate(signals)},
    )


def gaps_of(before: Floats, after: Floats, bins: Bins, held: Flags) -> tuple[float, float]:
    """Gap before and after as of `shrinkage_of`, without interval."""
    _, (whole_before, whole_after) = _gaps(_sums_of(before, after, bins, held)[1])
    return float(whole_before), float(whole_after)


def _sums_of(before: Floats, after: Floats, bins: Bins, held: Flags) -> tuple[list[int], Floats]:
    """Signals, and (3, signals, cycles) sums of what is beyond noise before and after, and of bins."""
    signals = [signal for signal in range(len(SIGNALS)) if np.any(held & (bins.signal == signal))]
    cycles, of_bin = np.unique(bins.cycle[held], return_inverse=True)
    sums = np.zeros((3, len(signals), cycles.size))
    for k, signal in enumerate(signals):
        rows = bins.signal[held] == signal
        for row, values in enumerate((_hard(before), _hard(after))):
            excess = values[held][rows] - bins.floor[held][rows]
            sums[row, k] = np.bincount(of_bin[rows], excess, cycles.size)
        sums[2, k] = np.bincount(of_bin[rows], minlength=cycles.size)
    return signals, sums


def _gaps(sums: Floats) -> tuple[Floats, Floats]:
    """(2, signals) gaps before and after of each signal, and (2,) of all."""
    total = sums.sum(axis=2)
    mean = np.maximum(total[:2] / np.maximum(total[2], 1.0), 0.0)
    return np.sqrt(FLOOR + mean), np.sqrt(FLOOR + mean.mean(axis=1))


def bootstrap(squares: Floats, cycle: Integers, rng: np.random.Generator) -> tuple[float, Interval]:
    """Gap of one cell from what its squares are over noise, with an interval over whole cycles."""
    _, inverse = np.unique(cycle, return_inverse=True)
    sums, counts = np.bincount(inverse, squares), np.bincount(inverse)

    def gap(drawn: Integers) -> float:
        return float(np.sqrt(FLOOR + max(sums[drawn].sum() / counts[drawn].sum(), 0.0)))

    values = [gap(rng.integers(0, sums.size, sums.size)) for _ in range(DRAWN)]
    low, high = np.quantile(values, [(1.0 - CONFIDENCE) / 2.0, (1.0 + CONFIDENCE) / 2.0])
    return gap(np.arange(sums.size)), (float(low), float(high))


def _hard(residuals: Floats) -> Floats:
    """Squares of residuals as they were before they were made soft."""
    return np.asarray((SOFT * np.sinh(residuals / SOFT)) ** 2, dtype=np.float64)


def _share(before: float, after: float) -> float:
    return (before - after) / (before - FLOOR) if before - FLOOR > NOTHING else 0.0
