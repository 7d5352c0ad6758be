"""What of the residuals repeats itself: the part that a perfect model could explain, whatever the noise is like."""

from typing import Any

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.residuals.bins import Bins

MIN_TRAINING = 4
PATTERN_ERRORS = 3.0
"""Standard errors by which a mean differs from 0 that repeats."""
PHASES_S = np.array([2, 4, 6, 8, 10, 12, 15, 20, 25, 30, 40, 60, 90, 150, 250, 400, 700, 1200])
NEIGHBOURS = 4


def repeating_squares(residuals: Floats, bins: Bins, training: Flags, pumps: int) -> Floats:
    """(bins,) drop of the square of each residual by what is expected of it; sums to what repeats.

    The mean of the residuals by signal, pump, regime and time since it began is expected; then a drift. Both are
    made of the `training` alone; the other bins are predicted by their neighbours in time.

    Parameters
    ----------
    residuals : (bins,) array
    training : (bins,) array
    pumps : int
        Cycles over which the drift is averaged, times `NEIGHBOURS`.
    """
    group = _group(bins)
    expected = _table(group * 32 + phase(bins), residuals, training)
    expected = expected + _drift(group, bins.cycle, residuals - expected, training, NEIGHBOURS * pumps)
    return np.asarray(residuals**2 - (residuals - expected) ** 2, dtype=np.float64)


def phase(bins: Bins) -> Integers:
    """(bins,) number of the span of `PHASES_S` since the regime of a signal and pump began."""
    return np.asarray(np.searchsorted(PHASES_S, _since(bins, _group(bins))))


def _group(bins: Bins) -> Integers:
    """(bins,) number of signal, regime and pump together."""
    return (bins.signal * len(REGIMES) + bins.regime) * 64 + bins.pump + 1


def _since(bins: Bins, group: Integers) -> Integers:
    """Seconds since the first bin of the same group and cycle."""
    key = group * (int(bins.cycle.max(initial=0)) + 1) + bins.cycle
    _, inverse = np.unique(key, return_inverse=True)
    first = np.full(inverse.max(initial=0) + 1, np.iinfo(np.int64).max)
    np.minimum.at(first, inverse, bins.second)
    return bins.second - first[inverse]


def _table(key: Integers, values: Floats, training: Flags) -> Floats:
    _, inverse = np.unique(key, return_inverse=True)
    count = np.bincount(inverse[training], minlength=inverse.max(initial=0) + 1)
    total = np.bincount(inverse[training], values[training], count.size)
    squares = np.bincount(inverse[training], values[training] ** 2, count.size)
    return _certain(total, squares, count)[inverse]


def _drift(group: Integers, cycle: Integers, values: Floats, training: Flags, width: int) -> Floats:
    """Mean of the training bins of the same group in the cycles around."""
    _, inverse = np.unique(group, return_inverse=True)
    cycles = int(cycle.max(initial=0)) + 1
    place = inverse * cycles + cycle
    size = (int(inverse.max(initial=0)) + 1) * cycles
    count = np.bincount(place[training], minlength=size)
    means = np.bincount(place[training], values[training], size) / np.maximum(count, 1)
    total, squares, weight = (
        _near(rows.reshape(-1, cycles), width) for rows in (means, means**2, (count > 0).astype(np.float64))
    )
    drift: Floats = _certain(total, squares, weight).ravel()[place]
    return drift


def _near(rows: Floats, width: int) -> Floats:
    """Sums over `width` columns on both sides."""
    window = np.ones(2 * width + 1)
    return np.array([np.convolve(row, window, mode="full")[width : width + row.size] for row in rows])


def _certain(total: npt.NDArray[Any], squares: npt.NDArray[Any], count: npt.NDArray[Any]) -> Floats:
    """Means that differ from 0 by `PATTERN_ERRORS` standard errors or more, else 0."""
    means = total / np.maximum(count, 1)
    variance = np.maximum(squares / np.maximum(count, 1) - means**2, 0.0) / np.maximum(count - 1, 1)
    return np.asarray(
        np.where((count >= MIN_TRAINING) & (means**2 > PATTERN_ERRORS**2 * variance), means, 0.0), dtype=np.float64
    )
