"""When a rounded level passes from one step to the next."""

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.recording.seconds import is_change

FEWEST_PASSAGES = 4
"""Passages around a turn: two on either side."""


def steps_m(level_m: Floats) -> Floats:
    """(n,) levels in the seconds in which a rounded value passes from one step to the next, NaN elsewhere.

    Then the level is midway between the two. Noise lets the value go to and fro while it passes: the mean of these
    seconds is the one. Half a second before a change, in the mean, it was midway; it goes on from there as fast as it
    moves between the passages before and after.

    Examples
    --------
    >>> steps_m(np.array([1.0, 1.0, np.nan, 1.2, 1.2, 1.4]))
    array([ nan,  nan,  nan, 1.15,  nan, 1.35])
    >>> steps_m(np.array([1.0, 1.0, 1.2, 1.0, 1.2, 1.2]))
    array([nan, nan, nan, 1.1, nan, nan])
    """
    known, second = np.flatnonzero(np.isfinite(level_m)), np.flatnonzero(is_change(level_m))
    midway_m = 0.5 * (level_m[second] + level_m[known[np.searchsorted(known, second) - 1]])
    begins = _begins(second, midway_m)
    passage, midway_m = np.cumsum(begins) - 1, midway_m[begins]
    mean_s = np.bincount(passage, second) / np.bincount(passage)
    told_m, told_s = np.full(level_m.size, np.nan), np.rint(mean_s)
    moves_m = np.diff(midway_m)
    pauses_s = np.diff(mean_s) * (moves_m != 0.0)  # where it turns, it moves on one side only
    moved_m, in_s = (np.r_[0.0, each] + np.r_[each, 0.0] for each in (moves_m, pauses_s))
    told_m[told_s.astype(np.int64)] = midway_m + (0.5 + told_s - mean_s) * moved_m / np.maximum(in_s, 1.0)
    return told_m


def between_steps_m(told_m: Floats) -> Floats:
    """(n,) levels in all seconds, from those in which a rounded one passes from step to step.

    Between two passages the level moves evenly. Where it turns between them, it goes on as before the first until it
    is where it comes from as after the second. NaN with fewer than four passages.

    Examples
    --------
    >>> between_steps_m(np.array([1.0, np.nan, 3.0, np.nan, np.nan, np.nan, 3.0, np.nan, 1.0]))
    array([1., 2., 3., 4., 5., 4., 3., 2., 1.])
    """
    at = np.flatnonzero(np.isfinite(told_m))
    if at.size < FEWEST_PASSAGES:
        return np.full(told_m.size, np.nan)
    known_m = told_m[at]
    rate_m_s = np.diff(known_m) / np.diff(at)
    second = np.arange(told_m.size)
    row = np.clip(np.searchsorted(at, second, side="right") - 1, 0, at.size - 2)
    before_m_s, after_m_s = rate_m_s[np.maximum(row - 1, 0)], rate_m_s[np.minimum(row + 1, rate_m_s.size - 1)]
    even_m = known_m[row] + rate_m_s[row] * (second - at[row])
    first_m = known_m[row] + before_m_s * (second - at[row])
    then_m = known_m[row + 1] + after_m_s * (second - at[row + 1])
    turned_m = np.where(before_m_s > 0.0, np.minimum(first_m, then_m), np.maximum(first_m, then_m))
    return np.where(before_m_s * after_m_s < 0.0, turned_m, even_m)


def _begins(second: Integers, midway_m: Floats) -> Flags:
    """(k,) whether a change is the first of a passage.

    An even number of changes about one level is two passages, one up and one down, with the longest pause between.
    An odd one is one passage, or three: if the longest pause is more than half of the time to another level, the
    level was away meanwhile.
    """
    begins = np.r_[True, np.diff(midway_m) != 0.0][: second.size]
    pause_s = np.diff(second, prepend=second[:1])
    row, inner, count = _groups(begins)
    apart_s = np.r_[pause_s[begins], 0]
    longer_s = np.maximum(apart_s[:-1], apart_s[1:])
    away_s = np.where(longer_s > 0, 0.5 * longer_s, np.inf)  # with no other level there is nothing to go by
    comes_back = (count[row] % 2 == 1) & (inner > 0) & (pause_s > away_s[row])
    begins[_longest(np.flatnonzero(comes_back), row, pause_s)] = True
    row, inner, count = _groups(begins)
    turns = (count[row] % 2 == 0) & (inner % 2 == 1)
    begins[_longest(np.flatnonzero(turns), row, pause_s)] = True
    return np.asarray(begins, dtype=np.bool_)


def _groups(begins: Flags) -> tuple[Integers, Integers, Integers]:
    """Group and place in it of each change, and how many are in each group."""
    first = np.flatnonzero(begins)
    row = np.cumsum(begins) - 1
    return row, np.arange(begins.size) - first[row], np.diff(first, append=begins.size)


def _longest(among: Integers, row: Integers, pause_s: Integers) -> Integers:
    """Of some changes that with the longest pause before it in each group."""
    by_pause = among[np.lexsort((pause_s[among], row[among]))]
    return np.asarray(by_pause[np.r_[np.diff(row[by_pause]) != 0, True][: by_pause.size]], dtype=np.int64)
