"""Whether the groups of a look differ from those of an earlier one, and since when."""

from collections.abc import Mapping

import numpy as np
from scipy.special import stdtrit

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.likelihood.covariance import CHANGING
from wetwell.sim2real.watch.look import Shift

FALSE_CHANGES = 1e-4
"""Share of looks at an unchanged station that may take it for changed; a diagnosis follows, and no name yet. [1]"""


def changed_groups(
    now: Mapping[str, Shift], before: Mapping[str, Shift], least: float = CHANGING, false: float = FALSE_CHANGES
) -> dict[str, float]:
    r"""Groups that have changed by more than a station may change by itself, the largest difference first.

    $$|d - d_0| - t_{\alpha / 2n} \sqrt{e^2 + e_0^2} > k$$

    with Student's t at a share α of false alarms, shared by n groups, and k the share of the material size that the
    likelihood lets change from cycle to cycle.

    Parameters
    ----------
    now, before : mapping of str to Shift
    least : float
        k, in units of what matters.
    false : float
        α.
    """
    found = {}
    for name, shift in now.items():
        known = before.get(name)
        mean, error, cycles = (0.0, 0.0, shift.cycles) if known is None else (known.mean, known.error, known.cycles)
        quantile = -stdtrit(min(shift.cycles, cycles) - 1, false / (2.0 * len(now)))
        if abs(shift.mean - mean) - quantile * np.hypot(shift.error, error) > least:
            found[name] = shift.mean - mean
    return dict(sorted(found.items(), key=lambda pair: -abs(pair[1])))


def step_ns(time_ns: Integers, means: Floats, before: float) -> int:
    r"""Time of the cycle from which on a group lies elsewhere: the step that leaves the least sum of squares.

    $$\min_k \sum_{c < k} (d_c - d_0)^2 + \sum_{c \ge k} (d_c - \overline{d}_{\ge k})^2$$

    Parameters
    ----------
    time_ns : (cycles,) array
    means : (cycles,) array
        Of one group, in units of what matters.
    before : float
        Where the group lay.

    Examples
    --------
    >>> step_ns(np.arange(6), np.array([0.1, -0.1, 0.0, 2.1, 1.9, 2.0]), 0.0)
    3
    """
    backward = means[::-1]
    counts = np.arange(1, means.size + 1)
    sums, squares = np.cumsum(backward), np.cumsum(backward**2)
    after = (squares - sums**2 / counts)[::-1]
    ahead = np.r_[0.0, np.cumsum((means - before) ** 2)[:-1]]
    return int(time_ns[int(np.argmin(ahead + after))])
