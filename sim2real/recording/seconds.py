"""Values on whole seconds: held on, repeated, averaged over the interval of a row."""

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.jit import compiled

GAUSSIAN_MAD = 0.6745
"""Median of what is off, without its sign, over the standard deviation of a normal distribution."""


def noise_by_bends(bends: Floats) -> float:
    """Standard deviation of values about their course, from second differences: few may be large; 0 of none.

    Examples
    --------
    >>> values = np.arange(9.0) + 0.5 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    >>> round(noise_by_bends(np.diff(values, n=2)), 2)
    1.21
    """
    return float(np.median(np.abs(bends)) / GAUSSIAN_MAD / np.sqrt(6.0)) if bends.size else 0.0


def filled(values: Floats, longest: int, otherwise: float) -> Floats:
    """Values with NaN replaced by the last one before, for at most `longest` places; else by `otherwise`.

    Examples
    --------
    >>> filled(np.array([np.nan, 1.0, np.nan, np.nan, 3.0]), 1, 0.0)
    array([0., 1., 1., 0., 3.])
    """
    place = np.arange(values.size)
    last = np.maximum.accumulate(np.where(np.isfinite(values), place, -1))
    held = np.where((last >= 0) & (place - last <= longest), values[last], otherwise)
    return np.asarray(held, dtype=np.float64)


def since_changes(key: Integers | Floats) -> Integers:
    """(n,) places since a key changed last.

    Examples
    --------
    >>> since_changes(np.array([7, 7, 7, 2, 2, 7]))
    array([0, 1, 2, 0, 1, 0])
    """
    place = np.arange(key.size)
    return place - np.maximum.accumulate(np.where(np.r_[True, key[1:] != key[:-1]], place, 0))


def repeated(values: Floats) -> Flags:
    """(..., n) whether a value is exactly the known one before; the zeros of a standing pump are not meant.

    Examples
    --------
    >>> repeated(np.array([2.0, np.nan, 2.0, 0.0, 0.0]))
    array([False, False,  True, False, False])
    """
    place = np.where(np.isfinite(values), np.arange(values.shape[-1]), -1)
    last = np.maximum.accumulate(place, axis=-1)[..., :-1]
    before = np.where(last >= 0, np.take_along_axis(values[..., :-1], np.maximum(last, 0), axis=-1), np.nan)
    same = np.zeros(values.shape, dtype=bool)
    same[..., 1:] = (values[..., 1:] == before) & (values[..., 1:] != 0.0)
    return same


def is_change(values: Floats) -> Flags:
    """(..., n) whether a value is another one than the known one before; what the first one was before is not known.

    Examples
    --------
    >>> is_change(np.array([2.0, np.nan, 2.0, 3.0, 3.0]))
    array([False, False, False,  True, False])
    """
    is_known = np.isfinite(values)
    return is_known & ~repeated(values) & (np.cumsum(is_known, axis=-1) > 1)


def trailing_means(values: Floats, span_s: int) -> Floats:
    """(..., n) mean of each value and those before it, `span_s` together; fewer at the beginning.

    Examples
    --------
    >>> trailing_means(np.array([1.0, 3.0, 5.0]), 2)
    array([1., 2., 4.])
    """
    if span_s == 1:
        return values
    means = np.empty_like(values)
    for series, found in zip(np.atleast_2d(values), np.atleast_2d(means), strict=True):
        _average(series, span_s, found)
    return means


@compiled
def _average(values: Floats, span_s: int, means: Floats) -> None:
    total = 0.0
    for k in range(values.size):
        total += values[k]
        if k >= span_s:
            total -= values[k - span_s]
        means[k] = total / min(k + 1, span_s)
