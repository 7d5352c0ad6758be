"""Inflow of a trial: two humps a day, a slow random part, pulses of rain."""

import numpy as np
from scipy.signal import lfilter

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.truth.case import TrueInflow

DAY_S = 86_400.0


def inflow_m3h(plan: TrueInflow, seconds: int, rng: np.random.Generator) -> Floats:
    r"""(seconds + 1,) inflow at the whole seconds, neither negative nor more than the sewer carries.

    $$Q = \bar Q \left(1 + a \left[0.6 \sin\left(2 \pi t / d - 1.8\right) + 0.4 \sin\left(4 \pi t / d\right)\right]
    + \sigma n\right) + \sum_j Q_r\, x_j e^{1 - x_j}, \qquad x_j = (t - t_j) / \tau$$

    with n an AR(1) of unit variance, $t_j$ at random.

    Examples
    --------
    >>> plan = TrueInflow(mean_m3h=100.0, swing=0.0, noise=0.0, rain_per_day=0.0)
    >>> inflow_m3h(plan, 2, np.random.default_rng(1))
    array([100., 100., 100.])
    """
    time_s = np.arange(seconds + 1, dtype=np.float64)
    turn = 2.0 * np.pi * time_s / DAY_S
    humps = 0.6 * np.sin(turn - 1.8) + 0.4 * np.sin(2.0 * turn)
    total = plan.mean_m3h * (1.0 + plan.swing * humps + plan.noise * slow_noise(seconds + 1, plan.noise_s, rng))
    for begin_s in rng.uniform(0.0, seconds, rng.poisson(plan.rain_per_day * seconds / DAY_S)):
        x = np.maximum(time_s - begin_s, 0.0) / plan.rain_s
        total += plan.rain_m3h * x * np.exp(1.0 - x)
    return np.clip(total, 0.0, plan.most_m3h)


def slow_noise(count: int, correlation_s: float, rng: np.random.Generator) -> Floats:
    """(count,) AR(1) of unit variance, one value a second, stationary from the first on."""
    share = np.exp(-1.0 / correlation_s)
    steps = rng.standard_normal(count)
    steps[1:] *= np.sqrt(1.0 - share**2)
    noise: Floats = lfilter([1.0], [1.0, -share], steps)
    return noise
