"""A random walk that is seen with errors: how large these are, and the walk without them."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar

from wetwell.protocols.arrays import Floats

SLOWEST_GAIN = 1e-4
"""Gain of a filter that hardly believes a new value: it looks back for some ten thousand of them. [1]"""


def likeliest_gain(values: Floats) -> float:
    r"""Gain K of the filter that predicts each value best from those before.

    $$v_t = x_t - m_{t-1}, \qquad m_t = m_{t-1} + K v_t$$

    Parameters
    ----------
    values : (n,) array
        Three at least, not all alike.

    References
    ----------
    .. [1] A. C. Harvey, Forecasting, structural time series models and the Kalman filter, 1989, section 4.3.
    """
    return gain_of_least(lambda gain: float(np.log(surprise(values, gain))))


def surprise(values: Floats, gain: float) -> float:
    """Mean square of what a filter of that gain did not predict; of it 1 - K is the variance of the errors."""
    from scipy.signal import lfilter  # noqa: PLC0415 - takes half a second, and most recordings need none

    level, _ = lfilter([gain], [1.0, gain - 1.0], values, zi=[(1.0 - gain) * values[0]])
    return float(np.mean((values[1:] - level[:-1]) ** 2))


def smoothed(values: Floats, gain: float) -> Floats:
    """(n,) the walk itself, by all values: weights fall by 1 - K from value to value on both sides.

    References
    ----------
    .. [1] A. C. Harvey, Forecasting, structural time series models and the Kalman filter, 1989, section 4.6.
    """
    from scipy.signal import filtfilt  # noqa: PLC0415 - as above

    ends = min(int(np.ceil(5.0 / gain)), values.size - 1)
    smooth: Floats = filtfilt([gain], [1.0, gain - 1.0], values, padtype="even", padlen=ends)
    return smooth


def gain_of_least(cost: Callable[[float], float]) -> float:
    """Gain of the least cost."""
    found = minimize_scalar(
        lambda log: cost(float(np.exp(log))), bounds=(np.log(SLOWEST_GAIN), -1e-9), method="bounded"
    )
    return float(np.exp(found.x))
