"""Errors of a user's column: how large they are, and the column without them."""

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.recording.random_walk import gain_of_least, likeliest_gain, smoothed, surprise
from wetwell.sim2real.recording.traces import Traces
from wetwell.simulator.corrections.parts import Column


def noise_of(traces: Traces, name: str) -> float:
    r"""Standard deviation of a column's own errors, if they have no memory and the column itself wanders.

    The random walk that is seen with errors whose filter, of gain K, predicts each value best from those before:

    $$\sigma^2 = (1 - K)\,\overline{v_t^2}, \qquad v_t = x_t - m_{t-1}, \quad m_t = m_{t-1} + K v_t$$

    A column that truly jumps up and down from value to value looks the same: whether its errors are taken off is for
    the evidence to say. 0 where there are none. [unit of the column]

    References
    ----------
    .. [1] A. C. Harvey, Forecasting, structural time series models and the Kalman filter, 1989, section 4.3.
    """
    course = traces.columns[name]
    values = _values(course[traces.is_row & np.isfinite(course)])[0]
    if values.size < 3 or np.ptp(values) == 0.0:
        return 0.0
    gain = likeliest_gain(values)
    return float(np.sqrt((1.0 - gain) * surprise(values, gain)))


def course_of(traces: Traces, column: Column) -> Floats:
    r"""(n,) a column in each second, without its errors: what it most likely was, by all that was recorded of it.

    The smoother of a random walk that is seen with errors, far from its ends: weights fall by $1 - K$ from value to
    value on both sides, with the K that is most likely where the errors are σ. A correction that goes by this instead
    of the values themselves is not too small by their errors.

    References
    ----------
    .. [1] A. C. Harvey, Forecasting, structural time series models and the Kalman filter, 1989, section 4.6.
    .. [2] R. J. Carroll and others, Measurement error in nonlinear models, 2006, chapter 4: regression calibration.
    """
    course = traces.columns[column.name]
    known = np.isfinite(course)
    rows = np.flatnonzero(traces.is_row & known)
    values, row_of_value = _values(course[rows])
    if column.noise == 0.0 or values.size < 3:
        return course

    def unlikely(gain: float) -> float:
        return (1.0 - gain) * surprise(values, gain) / column.noise**2 - float(np.log(1.0 - gain))

    smooth = smoothed(values, gain_of_least(unlikely))[row_of_value]
    place = np.flatnonzero(known)
    found = np.full(traces.seconds, np.nan)
    if traces.span_s > 1:
        found[place] = smooth[np.minimum(np.searchsorted(rows, place), rows.size - 1)]
    else:
        found[place] = np.interp(place, rows, smooth)
    return found


def _values(rows: Floats) -> tuple[Floats, Integers]:
    """Values that a column had one after the other, and which of them each row has: one may stand for many rows."""
    changes = np.flatnonzero(np.diff(rows))
    stands = max(int(np.median(np.diff(changes))), 1) if changes.size > 1 else 1
    return rows[::stands], np.arange(rows.size) // stands
