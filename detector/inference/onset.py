"""When a fault began, from the shifts of the runs up to its alarm."""

from collections.abc import Sequence

import numpy as np

CANDIDATES = 60


def onset_s(time_s: Sequence[float], shift_m: Sequence[float]) -> float:
    r"""Time at which a shift begins to grow: the corner of the broken line that fits best, the middle one of equals.

    $$\hat t_0 = \arg\min_{t_0} \min_b \sum_i \bigl(\Delta r_i - b\,(t_i - t_0)_+\bigr)^2$$

    Parameters
    ----------
    time_s, shift_m : (n,) sequences
        Runs in order of time, the last one at fault. [s, m]

    Returns
    -------
    onset : float
        Between the first and the last time. [s]

    Examples
    --------
    >>> round(onset_s([0.0, 100.0, 200.0, 300.0, 400.0], [0.0, 0.0, 0.0, 1.0, 2.0]), -1)
    200.0
    """
    time, shift = np.asarray(time_s, dtype=float), np.asarray(shift_m, dtype=float)
    if len(time) < 2:
        return float(time[-1])
    corners = np.linspace(time[0], time[-1], CANDIDATES, endpoint=False)
    ramps = np.maximum(time[None, :] - corners[:, None], 0.0)
    slopes = ramps @ shift / np.maximum(np.sum(ramps**2, axis=1), 1e-300)
    errors = np.sum((shift - slopes[:, None] * ramps) ** 2, axis=1)
    return float(np.median(corners[errors <= errors.min() * (1.0 + 1e-6) + 1e-12]))
