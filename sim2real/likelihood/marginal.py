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
        products of the columns, in its last n rows and columns.
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
    for k in range(size - columns.shape[1], size):
        for m in range(k + 1, size):
            joint[m, k] = joint[k, m]
    return log_det


@compiled
def alike(span: Integers, of_block: float, of_span: Floats, own: Floats, room: Floats, inverse: Floats) -> float:
    r"""Invert the covariance of groups that are off alike in a block, alike in a span, and each by itself.

    $$C = b^2 1 1^T + \sum_{\text{spans}} s s^T + \operatorname{diag}(g^2)$$

    by Woodbury's identity, once for each span and once for the block.

    Parameters
    ----------
    span : (groups,) array
        Numbers from 0.
    of_block : float
        b, standard deviation of what all groups share.
    of_span, own : (groups,) arrays
        s and g.
    room : (3, groups) array
        To come as zeros.
    inverse : (groups, groups) array
        Out.

    Returns
    -------
    log_determinant : float
        Of C.
    """
    alone, summed, excess = room[0], room[1], room[2]
    groups = span.size
    log_det = 0.0
    for i in range(groups):
        alone[i] = 1.0 / own[i] ** 2
        excess[span[i]] += alone[i] * of_span[i] ** 2
        log_det -= math.log(alone[i])
    total = 0.0
    for i in range(groups):
        log_det += math.log(1.0 + excess[i])  # of spans that there are not it is 0
        for j in range(groups):
            inverse[i, j] = 0.0
            if span[i] == span[j]:
                inverse[i, j] = -alone[i] * of_span[i] * alone[j] * of_span[j] / (1.0 + excess[span[i]])
        inverse[i, i] += alone[i]
        for j in range(groups):
            summed[i] += inverse[i, j]
        total += summed[i]
    further = 1.0 + of_block**2 * total
    for i in range(groups):
        for j in range(groups):
            inverse[i, j] -= of_block**2 / further * summed[i] * summed[j]
    return log_det + math.log(further)


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
