"""Inflow and slow wanderings of the elastic plant: a day by its hours, storms through a row of reservoirs."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import gamma as unit_hydrograph

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.truth.case import TrueInflow

HOUR_S, DAY_S = 3600.0, 86_400.0
# fmt: off
BY_HOUR = (
    -0.6, -0.8, -1.0, -1.0, -0.9, -0.5, 0.3, 0.9, 1.0, 0.8, 0.6, 0.5,
    0.5, 0.4, 0.2, 0.1, 0.1, 0.3, 0.6, 0.8, 0.6, 0.2, -0.2, -0.4,
)
# fmt: on
"""Shape of a dry day of a residential district from midnight on: low at 3, high at 8 and 19 o'clock. [1]"""
RESERVOIRS = 3.0
"""Of the cascade that a storm runs through (J. E. Nash 1957). [1]"""
KNOT_SHARE = 0.5
"""Time between the knots of a wandering, over its correlation time. [1]"""


def inflow_m3h(plan: TrueInflow, seconds: int, rng: np.random.Generator) -> Floats:
    """(seconds + 1,) inflow at the whole seconds: dry day, wandering, storms; between 0 and what the sewer carries.

    Parameters
    ----------
    plan : TrueInflow
        Its swing is half of the range of the dry day, its rain the peak of a storm after its time. [m³/h, 1, s]
    seconds : int
    rng : numpy.random.Generator
    """
    time_s = np.arange(seconds + 1, dtype=np.float64)
    hours = np.append(BY_HOUR, BY_HOUR[0])
    dry = CubicSpline(np.arange(hours.size) * HOUR_S, hours, bc_type="periodic")(time_s % DAY_S)
    total = plan.mean_m3h * (1.0 + plan.swing * dry + plan.noise * wandering(seconds + 1, plan.noise_s, rng))
    scale_s = plan.rain_s / (RESERVOIRS - 1.0)
    peak = unit_hydrograph.pdf(plan.rain_s, RESERVOIRS, scale=scale_s)
    for begin_s in rng.uniform(0.0, seconds, rng.poisson(plan.rain_per_day * seconds / DAY_S)):
        total += plan.rain_m3h / peak * unit_hydrograph.pdf(time_s - begin_s, RESERVOIRS, scale=scale_s)
    return np.clip(total, 0.0, plan.most_m3h)


def wandering(count: int, correlation_s: float, rng: np.random.Generator) -> Floats:
    """(count,) smooth random course of unit variance, a value a second: a spline through independent knots."""
    spacing_s = max(KNOT_SHARE * correlation_s, 1.0)
    knots = int(np.ceil(count / spacing_s)) + 3
    course = CubicSpline(np.arange(knots) * spacing_s, rng.standard_normal(knots))(np.arange(count, dtype=np.float64))
    values: Floats = course / _SPREAD
    return values


_SPREAD = 0.936
"""Standard deviation of a cubic spline through independent knots of unit variance: of 2e6 points of one. [1]"""
