"""Whether a channel comes late: by a constant time, or by the time of a clock that runs away or is set at times."""

import numpy as np
from scipy.stats import rankdata

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.sim2real.recording.regimes import START_RAMP, STOP_RAMP
from wetwell.sim2real.residuals.asinh_loss import residuals_of
from wetwell.sim2real.residuals.bins import FLOW, HEAD, LEVEL, POWER, START_LEVEL, STOP_LEVEL, Bins
from wetwell.sim2real.residuals.groups import groups_of

ALONE = 0.7
"""Share of the gap from which it is in one kind of signal alone. [1]"""
WHERE_IT_MOVES = 3.0
"""Gap where a channel moves over that elsewhere, from which it departs where it moves. [1]"""
DRIFT_BLOCKS = 12
"""Parts of a recording, and events at the least, from which a course over time is told."""
SWINGING = 0.4
"""Share of their scatter by which neighbours differ that swing with time; 1 by chance. [1]"""
UNLIKE = 0.2
"""Scatter of what starts depart by, over their mean, from which they are not alike. [1]"""
EVER_LATER = 0.7
"""Rank correlation of blocks with time that chance passes in fewer than one recording of a hundred. [1]"""
OF_CHANNEL: dict[AnalogueQuantity, tuple[int, ...]] = {
    "flow_m3h": (FLOW,),
    "head_m": (HEAD,),
    "power_kw": (POWER,),
    "level_m": (LEVEL, START_LEVEL, STOP_LEVEL),
}
"""Signals in which the readings of a channel depart."""


def is_late(by_signal: Floats, excess: Floats, residuals: Floats, bins: Bins) -> bool:
    """Whether one channel departs where it moves: it comes late, or its clock runs away, or is set at times.

    What is late is too low at starts and too high at stops; where a head tells nothing of stops, it is too low at
    starts, and ever more. A flow meter follows slowly or cuts off, but alike in
    each start. How far a level is off goes by the inflow, which has one side grow while the other shrinks.

    Parameters
    ----------
    by_signal : (signals,) array
        Sums of `excess`, no less than 0.
    excess : (bins,) array
        What of the square of each residual is beyond noise.
    residuals : (bins,) array
        As `asinh_loss` makes them.
    bins : Bins
    """
    is_start, is_stop = bins.regime == START_RAMP, bins.regime == STOP_RAMP
    is_ramp = is_start | is_stop
    for signal in (FLOW, HEAD, POWER):
        rows = bins.signal == signal
        if by_signal[signal] > ALONE * by_signal.sum():
            if mean_of(excess, rows & is_ramp) <= WHERE_IT_MOVES * mean_of(excess, rows & ~is_ramp):
                return False
            if signal == FLOW:
                return _wanders_slowly(_of_events(residuals, bins, rows & is_start))
            if not (rows & is_stop).any():
                return _grows(-_of_events(residuals, bins, rows & is_start))
            return mean_of(residuals, rows & is_start) < 0.0 < mean_of(residuals, rows & is_stop)
    if by_signal[list(OF_CHANNEL["level_m"])].sum() > ALONE * by_signal.sum():
        starts, stops = (_of_events(residuals, bins, bins.signal == one) for one in (START_LEVEL, STOP_LEVEL))
        return (_grows(-starts) and _grows(stops)) or _is_behind(excess, residuals, bins)
    return False


def are_ahead(by_signal: Floats, residuals: Floats, bins: Bins) -> bool:
    """Whether most of the gap is of pumps, all of whose readings come before their frequency: that is late then.

    Flow, head and power are too high at starts and too low at stops. The level has passed the start level when a pump
    is seen to start, and the stop level when it is seen to stop: with a shorter ramp it has not.

    Parameters
    ----------
    by_signal, residuals, bins
        As of `is_late`.
    """
    shown = [rows for rows in (bins.signal == one for one in (FLOW, HEAD, POWER)) if rows.any()]
    starts = [*(rows & (bins.regime == START_RAMP) for rows in shown), bins.signal == START_LEVEL]
    stops = [*(rows & (bins.regime == STOP_RAMP) for rows in shown), bins.signal == STOP_LEVEL]
    return by_signal[[FLOW, HEAD, POWER]].sum() > 0.5 * by_signal.sum() and all(
        mean_of(residuals, one) > 0.0 > mean_of(residuals, other) for one, other in zip(starts, stops, strict=True)
    )


def _is_behind(excess: Floats, residuals: Floats, bins: Bins) -> bool:
    """Whether a level reads too low where pumps start and too high where they stop, and leaves its course there.

    All by more than noise: another area or a slow sensor moves no start, and another start level no level.
    """
    starts, stops, level = (bins.signal == one for one in (START_LEVEL, STOP_LEVEL, LEVEL))
    parts = starts, stops, level & (bins.regime == START_RAMP), level & (bins.regime == STOP_RAMP)
    is_off = all(mean_of(excess, rows) > 1.0 for rows in parts)
    return is_off and mean_of(residuals, starts) < 0.0 < mean_of(residuals, stops)


def _of_events(residuals: Floats, bins: Bins, rows: Flags) -> Floats:
    """(events,) means over starts, or stops, in order of time."""
    events = groups_of(bins.cycle * 64 + bins.pump + 1, rows)
    return events.means(residuals_of(residuals))[np.argsort(events.means(bins.second.astype(np.float64)))]


def _wanders_slowly(events: Floats) -> bool:
    """Whether they differ by a good part of themselves, and neighbours by less than those that lie apart."""
    if events.size < DRIFT_BLOCKS:
        return False
    square = float(np.var(events))
    is_smooth = float(np.mean(np.diff(events) ** 2)) / 2.0 < SWINGING * square
    return is_smooth and square > (UNLIKE * float(np.mean(events))) ** 2


def _grows(events: Floats) -> bool:
    """Whether they are positive at the end, and the larger the later."""
    if events.size < DRIFT_BLOCKS:
        return False
    means = block_means(events)
    rank, place = (one - one.mean() for one in (rankdata(means), np.arange(DRIFT_BLOCKS)))
    return bool(means[-1] > 0.0 and float(rank @ place) > EVER_LATER * float(place @ place))


def block_means(values: Floats) -> Floats:
    """(`DRIFT_BLOCKS`,) means of values in order of time, at least as many as blocks."""
    return np.array([part.mean() for part in np.array_split(values, DRIFT_BLOCKS)])


def mean_of(values: Floats, rows: Flags) -> float:
    """Mean of (bins,) values over some rows, 0 of none."""
    return float(values[rows].mean()) if rows.any() else 0.0
