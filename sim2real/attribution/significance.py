"""Whether a sum over cycles is beyond chance."""

import numpy as np

from wetwell.protocols.arrays import Floats

LIBRARY_ERRORS = 4.0
"""Standard errors: 3 for one trial, 4 for a library of them."""
CLIP = 4.0
"""Medians beyond which a cycle counts no more, so that few large ones do not pass for scatter."""
STRONG = 40.0
"""Drop of the sum of squares of a cycle that noise does not bring about."""
MIN_STRONG = 3
OVERWHELMING = 1000.0
"""Drop of the sum of squares of which two cycles are enough: pumps that seldom run together."""
MOST_LOSS = 0.2


def is_significant(by_cycle: Floats) -> bool:
    """Whether most cycles agree that something helps, or some do strongly and hardly any disagrees.

    Parameters
    ----------
    by_cycle : (cycles,) array
        Drop of the sum of squares of each cycle, in units of noise.

    Examples
    --------
    >>> is_significant(np.full(20, 1.0)), is_significant(np.array([1.0, -1.0] * 10))
    (True, False)
    >>> is_significant(np.array([0.0] * 90 + [500.0] * 4))
    True
    """
    gain, loss = float(by_cycle[by_cycle > 0.0].sum()), -float(by_cycle[by_cycle < 0.0].sum())
    are_strong = int(np.sum(by_cycle > STRONG)) >= MIN_STRONG or int(np.sum(by_cycle > OVERWHELMING)) >= 2
    if are_strong and loss < MOST_LOSS * gain:
        return True
    size = float(np.median(np.abs(by_cycle))) if by_cycle.size else 0.0
    clipped = np.clip(by_cycle, -CLIP * size, CLIP * size)
    return float(clipped.sum()) > LIBRARY_ERRORS * max(float(np.sqrt(np.sum(clipped**2))), 1e-12)
