"""How fast what bins show changes in time."""

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.residuals.bins import Bins
from wetwell.sim2real.residuals.phases import group_of


def rate_of(bins: Bins, values: Floats) -> Floats:
    """(bins,) change per second of (bins,) values, between the bins before and after of the same signal and cycle.

    Values are in units of the deviation of their bin, which may differ from that of the next. A bin without a
    neighbour has 0.
    """
    order = np.lexsort((bins.second, bins.cycle, group_of(bins)))
    group, cycle, second = group_of(bins)[order], bins.cycle[order], bins.second[order]
    ordered = (values * bins.deviation)[order]
    follows = np.r_[False, (group[1:] == group[:-1]) & (cycle[1:] == cycle[:-1])]
    place = np.arange(order.size)
    before, after = place - follows, place + np.r_[follows[1:], False][: order.size]
    span_s = second[after] - second[before]
    rate = np.where(span_s > 0, (ordered[after] - ordered[before]) / np.maximum(span_s, 1), 0.0)
    found = np.empty(order.size)
    found[order] = rate
    return np.asarray(found / bins.deviation, dtype=np.float64)
