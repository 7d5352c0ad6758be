"""Means of groups, and how their cells scatter around them, under each way in which cycles may differ."""

import math

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled, inlined


@compiled
def scatter_of(
    residuals: Floats, variance: Floats, group: Integers, precision: Floats, means: Floats, logs: Floats
) -> None:
    r"""Weigh each cell by its variance, each group by itself.

    $$P = \sum \frac{1}{v_i}, \qquad m = \frac1P \sum \frac{r_i}{v_i},
    \qquad \ln p = -\tfrac12 \left(\sum \left(\frac{(r_i - m)^2}{v_i} + \ln v_i\right) + \ln P\right)$$

    Parameters
    ----------
    residuals : (cells,) array
        r.
    variance : (ways, cells) array
        v.
    group : (cells,) array
        Numbers from 0.
    precision, means, logs : (ways, groups) arrays
        P, m and ln p; to come as zeros.
    """
    for way in range(variance.shape[0]):
        for i in range(residuals.size):
            precision[way, group[i]] += 1.0 / variance[way, i]
            means[way, group[i]] += residuals[i] / variance[way, i]
        for g in range(precision.shape[1]):
            means[way, g] /= precision[way, g]
            logs[way, g] = -0.5 * math.log(precision[way, g])
        for i in range(residuals.size):
            away = residuals[i] - means[way, group[i]]
            logs[way, group[i]] -= 0.5 * (away * away / variance[way, i] + math.log(variance[way, i]))


@compiled
def settled(
    residuals: Floats,
    alone: Floats,
    shared: Floats,
    precision: Floats,
    cells: Integers,
    first: Integers,
    cycle: Integers,
    by_cycle: Floats,
    starts: Integers,
    logs: Floats,
) -> None:
    r"""Weigh the ways of all groups together: what the cells of a cycle share counts once.

    $$\ln p = -\tfrac12 \left(\sum_i \left(\frac{r_i^2}{v_i} + \ln v_i\right)
    + \sum_c \left(\ln A_c - \frac{B_c^2}{A_c}\right) + \sum_g \ln P_g \right), \qquad
    A_c = 1 + \sum_c \frac{d_i^2}{v_i}, \quad B_c = \sum_c \frac{d_i r_i}{v_i}$$

    From the likeliest start each group in turn takes the way that is likeliest beside those of the others.

    Parameters
    ----------
    residuals : (ways, cells) array
        r, from the mean of their group.
    alone, shared : (ways, cells) arrays
        v, variance of each cell by itself, and d, standard deviation of what the cells of its cycle share.
    precision : (ways, groups) array
        P, of the means.
    cells, first : (cells,), (groups + 1,) arrays
        Cells group by group, and where each group begins there.
    cycle : (cells,) array
        Numbers from 0.
    by_cycle : (2, cycles) array
        Room for A and B.
    starts : (starts, groups) array
        Ways of the groups to begin with; the likeliest are changed.
    logs : (ways, groups) array
        Out: of each way of a group beside what the others have, but for a constant of each group.
    """
    ways, groups = precision.shape
    inner, along = by_cycle[0], by_cycle[1]
    best, likeliest = 0, -math.inf
    for start in range(starts.shape[0]):
        log = _all_added(residuals, alone, shared, precision, cells, first, cycle, starts[start], inner, along)
        if log > likeliest:
            best, likeliest = start, log
    chosen = starts[best]
    _all_added(residuals, alone, shared, precision, cells, first, cycle, chosen, inner, along)
    for g in range(groups):
        its = cells[first[g] : first[g + 1]]
        _add(residuals, alone, shared, its, cycle, chosen[g], -1.0, inner, along)
        for way in range(ways):
            log = math.log(precision[way, g])
            for i in its:
                share = shared[way, i] / alone[way, i]
                its_inner = inner[cycle[i]] + share * shared[way, i]
                its_along = along[cycle[i]] + share * residuals[way, i]
                log += residuals[way, i] ** 2 / alone[way, i] + math.log(alone[way, i] * its_inner)
                log -= its_along * its_along / its_inner
            logs[way, g] = -0.5 * log
            if way == 0 or logs[way, g] > logs[chosen[g], g]:
                chosen[g] = way
        _add(residuals, alone, shared, its, cycle, chosen[g], 1.0, inner, along)


@inlined
def _all_added(
    residuals: Floats,
    alone: Floats,
    shared: Floats,
    precision: Floats,
    cells: Integers,
    first: Integers,
    cycle: Integers,
    chosen: Integers,
    inner: Floats,
    along: Floats,
) -> float:
    """Add all cells to the sums of their cycles, from nothing, and give the logarithm of their probability."""
    inner[:] = 1.0
    along[:] = 0.0
    log = 0.0
    for g in range(chosen.size):
        its, way = cells[first[g] : first[g + 1]], chosen[g]
        log += math.log(precision[way, g])
        for i in its:
            log += residuals[way, i] ** 2 / alone[way, i] + math.log(alone[way, i])
        _add(residuals, alone, shared, its, cycle, way, 1.0, inner, along)
    for c in range(inner.size):
        log += math.log(inner[c]) - along[c] * along[c] / inner[c]
    return -0.5 * log


@inlined
def _add(
    residuals: Floats,
    alone: Floats,
    shared: Floats,
    its: Integers,
    cycle: Integers,
    way: int,
    sign: float,
    inner: Floats,
    along: Floats,
) -> None:
    """Add cells to the sums of their cycles, or take them away."""
    for i in its:
        share = sign * shared[way, i] / alone[way, i]
        inner[cycle[i]] += share * shared[way, i]
        along[cycle[i]] += share * residuals[way, i]
