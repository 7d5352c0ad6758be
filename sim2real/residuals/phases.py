"""Which signal of which pump a bin is of, and how long its regime had lasted."""

import numpy as np

from wetwell.protocols.arrays import Flags, Integers
from wetwell.sim2real.recording.regimes import IDLE, REGIMES
from wetwell.sim2real.residuals.bins import Bins

PHASES_S = np.array([2, 4, 6, 8, 10, 12, 15, 20, 25, 30, 40, 60, 90, 150, 250, 400, 700, 1200])
"""Ends of spans of the time since a regime began. [s]"""

FOLLOWED_S = 60
"""Time at rest after which the level shows nothing of the pumps: the observer has followed it. [s]"""


def phase(bins: Bins) -> Integers:
    """(bins,) number of the span of `PHASES_S` since the regime of a signal and pump began."""
    return np.asarray(np.searchsorted(PHASES_S, since_begun_s(bins)))


def settled_at_rest(bins: Bins) -> Flags:
    """(bins,) whether no pump has run for `FOLLOWED_S`."""
    return np.asarray((bins.regime == IDLE) & (phase(bins) > np.searchsorted(PHASES_S, FOLLOWED_S)))


def group_of(bins: Bins) -> Integers:
    """(bins,) number of signal, regime and pump together."""
    return (bins.signal * len(REGIMES) + bins.regime) * 64 + bins.pump + 1


def since_begun_s(bins: Bins) -> Integers:
    """(bins,) seconds since the first bin of the same signal, regime, pump and cycle."""
    key = group_of(bins) * (int(bins.cycle.max(initial=0)) + 1) + bins.cycle
    _, inverse = np.unique(key, return_inverse=True)
    first = np.full(inverse.max(initial=0) + 1, np.iinfo(np.int64).max)
    np.minimum.at(first, inverse, bins.second)
    return bins.second - first[inverse]
