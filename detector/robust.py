"""Scatter from medians: what stands out does not count."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

NORMAL_MEDIAN = 1.4826
"""Standard deviation of normal numbers over the median of their size."""
STEP_MEDIAN = 0.91
"""Median of the square of the difference of two standard normal numbers."""


def step_variance(values: Floats) -> Floats:
    """(k,) variance of the columns of (n, k) values, from the median step between neighbours; n >= 2.

    Examples
    --------
    >>> step_variance(np.array([[0.0], [1.0], [0.0], [1.0], [50.0], [51.0]])).round(1).tolist()
    [1.1]
    """
    variance: Floats = np.median(np.diff(values, axis=0) ** 2, axis=0) / STEP_MEDIAN
    return variance
