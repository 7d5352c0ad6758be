"""A measured inflow as the level feels it: what its readings in rows say of the time between them."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.recording.random_walk import likeliest_gain, smoothed, surprise
from wetwell.sim2real.recording.seconds import noise_by_bends
from wetwell.sim2real.recording.traces import Traces

LEAST_ROWS = 3
"""Under so many rows a course cannot bend: nothing is smoothed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeteredInflow:
    """What comes in by the meter, and how far that may be off.

    Attributes
    ----------
    course_m3h : (n,) array
        In each second. [m³/h]
    error_m3h : float
        Standard deviation of its error, which goes over slowly. [m³/h]
    kept : float
        Share of that error that is left after a second. [1]
    between_m3h : float
        Standard deviation of what the mean between two rows is off besides, each by itself. [m³/h]
    """

    course_m3h: Floats
    error_m3h: float
    kept: float
    between_m3h: float


def metered_inflow(traces: Traces) -> MeteredInflow | None:
    r"""The inflow without what readings of moments have of these moments alone; None where it is not measured.

    A reading of a moment has the error of the meter, and waves that are over before the next row. The level feels
    neither. By the readings themselves the inflow is a random walk that is seen with errors σ, and its filter has the
    gain K. The smoother's error has no more to do with what it tells, so that no slope of the level gets too small by
    it. It is alike from row to row:

    $$\operatorname{var} = \sigma^2 \frac{K}{2 - K}, \qquad \operatorname{corr}_k = (1 - K)^k$$

    On its way from row to row the walk leaves a straight line, by a twelfth of the variance of its step. Means of
    intervals are what came in; what they may be off is not known, so it is taken from their bends.

    References
    ----------
    .. [1] A. C. Harvey, Forecasting, structural time series models and the Kalman filter, 1989, section 4.6.
    .. [2] R. J. Carroll and others, Measurement error in nonlinear models, 2006, chapter 4: regression calibration.
    """
    course = traces.inflow_m3h
    if course is None:
        return None
    if traces.is_each_second:
        return MeteredInflow(course_m3h=course, error_m3h=0.0, kept=1.0, between_m3h=0.0)
    rows = np.flatnonzero(traces.is_row)
    values = course[rows]
    if traces.value == "mean" or values.size < LEAST_ROWS or np.ptp(values) == 0.0:
        return MeteredInflow(
            course_m3h=course, error_m3h=0.0, kept=1.0, between_m3h=noise_by_bends(np.diff(values, n=2))
        )
    gain = likeliest_gain(values)
    unforeseen = surprise(values, gain)
    return MeteredInflow(
        course_m3h=np.interp(np.arange(course.size), rows, smoothed(values, gain)),
        error_m3h=float(np.sqrt((1.0 - gain) * unforeseen * gain / (2.0 - gain))),
        kept=float((1.0 - gain) ** (1.0 / traces.rate_s)),
        between_m3h=float(gain * np.sqrt(unforeseen / 12.0)),
    )
