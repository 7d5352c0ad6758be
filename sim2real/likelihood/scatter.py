"""Means of groups, and how their cells scatter around them, under each variance that the cells may have."""

import math

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled


@compiled
def scatter_of(
    residuals: Floats,
    noise: Floats,
    allowed: Floats,
    form: Floats,
    group: Integers,
    offsets: Floats,
    precision: Floats,
    means: Floats,
    logs: Floats,
) -> None:
    r"""Weigh each cell by its variance.

    $$w_i = \frac{1}{\sigma_i^2 + (o\,a_i)^2 + e_i^2}, \qquad P = \sum w_i, \qquad m = \frac{\sum w_i r_i}{P},
    \qquad \ln p = -\tfrac12 \left(\sum \left(w_i (r_i - m)^2 - \ln w_i\right) + \ln P\right)$$

    Parameters
    ----------
    residuals, noise : (cells,) arrays
        r, and σ².
    allowed : (cells,) array
        a.
    form : (ways, cells) array
        e, error of form.
    group : (cells,) array
        Numbers from 0.
    offsets : (ways,) array
        o.
    precision, means, logs : (ways, groups) arrays
        P, m and ln p; to come as zeros.
    """
    for way in range(offsets.size):
        offset = offsets[way] ** 2
        for i in range(residuals.size):
            weight = 1.0 / (noise[i] + offset * allowed[i] ** 2 + form[way, i] ** 2)
            precision[way, group[i]] += weight
            means[way, group[i]] += weight * residuals[i]
        for g in range(precision.shape[1]):
            means[way, g] /= precision[way, g]
            logs[way, g] = -0.5 * math.log(precision[way, g])
        for i in range(residuals.size):
            variance = noise[i] + offset * allowed[i] ** 2 + form[way, i] ** 2
            away = residuals[i] - means[way, group[i]]
            logs[way, group[i]] -= 0.5 * (away * away / variance + math.log(variance))
