"""Elimination of what cells share and nobody knows: of each cycle, and of each load on the groups."""

import math

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled, inlined


@compiled
def eliminated(
    columns: Floats,
    weight: Floats,
    in_cycle: Floats,
    loads: Floats,
    group: Integers,
    cycle: Integers,
    joint: Floats,
    by_cycle: Floats,
) -> float:
    r"""Integrate out unknowns whose normal equations the cells add to.

    Each cell is a row a of loads and columns, of weight w. A cycle of precision 1 enters its cells by d, and then the
    unknowns of the loads are eliminated one by one, by Cholesky's method:

    $$M = P + \sum_i w_i a_i a_i^T - \sum_c \frac{v_c v_c^T}{1 + \sum_c w d^2}, \quad v_c = \sum_c w d a, \qquad
    M_{zz} - M_{zx} M_{xx}^{-1} M_{xz}$$

    Parameters
    ----------
    columns : (cells, n) array
    weight : (cells,) array
        Inverse of the variance of each cell by itself.
    in_cycle : (cells,) array
        d, standard deviation of what the cells of a cycle share.
    loads : (parts, cells) array
        Of each unknown of a group on its cells.
    group, cycle : (cells,) arrays
        Numbers from 0.
    joint : (parts · groups + n, parts · groups + n) array
        P above its diagonal, the precision of the unknowns; zeros where the columns are. To hold what is left, the
        products of the columns, in the upper triangle of its last n rows.
    by_cycle : (cycles, parts · groups + n + 1) array
        To come as zeros.

    Returns
    -------
    log_determinant : float
        Of what was eliminated.
    """
    _add_cells(columns, weight, in_cycle, loads, group, cycle, joint, by_cycle)
    size = joint.shape[0]
    log_det = 0.0
    for c in range(by_cycle.shape[0]):
        row = by_cycle[c]
        precision = 1.0 + row[size]
        log_det += math.log(precision)
        for k in range(size):
            if row[k] != 0.0:
                _less(joint[k, k:], row[k:size], row[k] / precision)
    for k in range(size - columns.shape[1]):
        pivot = joint[k, k]
        log_det += math.log(pivot)
        for m in range(k + 1, size):
            if joint[k, m] != 0.0:
                _less(joint[m, m:], joint[k, m:], joint[k, m] / pivot)
    return log_det


@inlined
def _add_cells(
    columns: Floats,
    weight: Floats,
    in_cycle: Floats,
    loads: Floats,
    group: Integers,
    cycle: Integers,
    joint: Floats,
    by_cycle: Floats,
) -> None:
    """Add each cell to the sums of all, and to those of its cycle."""
    parts, count, size = loads.shape[0], columns.shape[1], joint.shape[0]
    unknown = size - count
    groups = unknown // parts
    for i in range(weight.size):
        row = by_cycle[cycle[i]]
        of_cycle = weight[i] * in_cycle[i]
        for p in range(parts):
            place = p * groups + group[i]
            load = weight[i] * loads[p, i]
            row[place] += of_cycle * loads[p, i]
            for q in range(p, parts):
                joint[place, q * groups + group[i]] += load * loads[q, i]
            for k in range(count):
                joint[place, unknown + k] += load * columns[i, k]
        for k in range(count):
            row[unknown + k] += of_cycle * columns[i, k]
            weighed = weight[i] * columns[i, k]
            for m in range(k, count):
                joint[unknown + k, unknown + m] += weighed * columns[i, m]
        row[size] += of_cycle * in_cycle[i]


@inlined
def _less(values: Floats, others: Floats, share: float) -> None:
    """Take a share of others from values."""
    for k in range(values.size):
        values[k] -= share * others[k]
