"""Parts of a long recording, spread over all of it, so that a month is diagnosed about as quickly as two days."""

from dataclasses import replace

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.recording.drives import Drives
from wetwell.sim2real.recording.traces import Traces

MOST_DIAGNOSED_S = 172_800
PART_S = 14_400
SEARCHED_S = 3_600
"""How far the edge of a part is moved to a second in which no pump runs."""
BLANK_S = 330
"""Seconds without values between two parts: after so many the observer of the level begins anew."""
GOLDEN = 0.6180339887498949


def excerpt(traces: Traces, most_s: int = MOST_DIAGNOSED_S) -> Traces:
    """Traces of at most about `most_s`: whole ones, or parts of four hours each, one after the other.

    The recording is split into as many stretches as there are parts; where in its stretch a part lies goes by the
    golden section, so that all hours of the day have their turn.

    Parameters
    ----------
    traces : Traces
    most_s : int
        [s]
    """
    if traces.seconds <= most_s:
        return traces
    count = max(most_s // PART_S, 1)
    stretch_s = traces.seconds / count
    idle = np.flatnonzero(~np.any(traces.frequency_hz > 0.0, axis=0))
    parts, last = [], 0
    for k in range(count):
        begin = round(k * stretch_s + (k * GOLDEN % 1.0) * (stretch_s - PART_S))
        first = max(_near(idle, begin), last)
        last = max(min(_near(idle, begin + PART_S) + 1, traces.seconds), first)
        parts.append(np.arange(first, last))
    return _of_rows(traces, parts)


def _near(idle: Integers, second: int) -> int:
    """First idle second from `second` on, or `second` itself where there is none for an hour."""
    place = int(np.searchsorted(idle, second))
    if place < idle.size and idle[place] - second <= SEARCHED_S:
        return int(idle[place])
    return second


def _of_rows(traces: Traces, parts: list[Integers]) -> Traces:
    blank = np.full(BLANK_S, -1)
    rows = np.concatenate([row for part in parts for row in (part, blank)][:-1])
    is_blank = rows < 0
    time_s = traces.time_s[rows].copy()
    since = np.arange(rows.size) - np.maximum.accumulate(np.where(is_blank, -1, np.arange(rows.size)))
    time_s[is_blank] = time_s[np.arange(rows.size) - since][is_blank] + since[is_blank]

    def taken(values: Floats, otherwise: float) -> Floats:
        chosen: Floats = np.where(is_blank, otherwise, values[..., rows])
        return chosen

    return replace(
        traces,
        time_s=time_s,
        is_row=~is_blank & traces.is_row[rows],
        drives=Drives(
            frequency_hz=taken(traces.frequency_hz, 0.0),
            placements=tuple(taken(one, 0.0) for one in traces.drives.placements),
            open_s=taken(traces.drives.open_s, 0.0),
        ),
        level_m=taken(traces.level_m, np.nan),
        inflow_m3h=None if traces.inflow_m3h is None else taken(traces.inflow_m3h, 0.0),
        signals={name: taken(values, np.nan) for name, values in traces.signals.items()},
    )
