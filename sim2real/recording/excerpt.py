"""Parts of a long recording, spread over all of it, so that a month is diagnosed about as quickly as two days."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.recording.drives import Drives
from wetwell.sim2real.recording.traces import BETWEEN, Traces

MOST_DIAGNOSED_S = 172_800
MOST_OF_ROWS_S = 1_209_600
"""Most of a recording of each second, and of one that is slower: its residuals are few. [s]"""
PART_S = 14_400
PART_OF_ROWS_S = 86_400
"""Length of a part of either. [s]"""
SEARCHED_S = 3_600
"""How far the edge of a part is moved to a second in which no pump runs."""
BLANK_S = 330
"""Seconds without values between two parts, or three rows: after so many the observer of the level begins anew."""
GOLDEN = 0.6180339887498949


def excerpt(traces: Traces, most_s: int | None = None) -> Traces:
    """Traces of at most about `most_s`: whole ones, or parts of four hours each, one after the other.

    Rows that are slower than a second are taken for longer, in parts of a day.

    The recording is split into as many stretches as there are parts; where in its stretch a part lies goes by the
    golden section, so that all hours of the day have their turn.

    Parameters
    ----------
    traces : Traces
    most_s : int, optional
        `MOST_DIAGNOSED_S` or `MOST_OF_ROWS_S`. [s]
    """
    part_s = PART_S if traces.is_each_second else PART_OF_ROWS_S
    if most_s is None:
        most_s = MOST_DIAGNOSED_S if traces.is_each_second else MOST_OF_ROWS_S
    if traces.seconds <= most_s:
        return traces
    part_s = min(part_s, most_s)
    count = max(most_s // part_s, 1)
    stretch_s = traces.seconds / count
    idle = np.flatnonzero(~np.any(traces.frequency_hz > 0.0, axis=0))
    parts, last = [], 0
    for k in range(count):
        begin = round(k * stretch_s + (k * GOLDEN % 1.0) * (stretch_s - part_s))
        first = max(_near(idle, begin), last)
        last = max(min(_near(idle, begin + part_s) + 1, traces.seconds), first)
        parts.append(np.arange(first, last))
    return with_blanks(traces, parts)


def _near(idle: Integers, second: int) -> int:
    """First idle second from `second` on, or `second` itself where there is none for an hour."""
    place = int(np.searchsorted(idle, second))
    if place < idle.size and idle[place] - second <= SEARCHED_S:
        return int(idle[place])
    return second


def with_blanks(traces: Traces, parts: Sequence[Integers]) -> Traces:
    """Some parts of traces, one after the other, with `BLANK_S` between them in which nothing is known.

    Parameters
    ----------
    traces : Traces
    parts : sequence of arrays
        Seconds of each part, in their order.
    """
    blank = np.full(max(BLANK_S, round(3.0 * traces.rate_s)), -1)
    rows = np.concatenate([row for part in parts for row in (part, blank)][:-1])
    is_blank = rows < 0
    is_cut = np.concatenate([np.arange(part.size + blank.size) < traces.span_s - 1 for part in parts])[: rows.size]
    time_s = traces.time_s[rows].copy()
    since = np.arange(rows.size) - np.maximum.accumulate(np.where(is_blank, -1, np.arange(rows.size)))
    time_s[is_blank] = time_s[np.arange(rows.size) - since][is_blank] + since[is_blank]

    def taken(values: Floats, otherwise: float) -> Floats:
        chosen: Floats = np.where(is_blank, otherwise, values[..., rows])
        return chosen

    return replace(
        traces,
        time_s=time_s,
        is_row=~is_blank & ~is_cut & traces.is_row[rows],
        drives=Drives(
            frequency_hz=taken(traces.frequency_hz, 0.0),
            placements=tuple(taken(one, 0.0) for one in traces.drives.placements),
            open_s=taken(traces.drives.open_s, 0.0),
        ),
        level_m=np.where(is_cut, np.nan, taken(traces.level_m, np.nan)),
        inflow_m3h=None if traces.inflow_m3h is None else taken(traces.inflow_m3h, 0.0),
        by_hand=traces.by_hand.taken(rows),
        part=np.where(is_blank, BETWEEN, traces.part[rows]),
        signals={name: np.where(is_cut, np.nan, taken(values, np.nan)) for name, values in traces.signals.items()},
        columns={name: taken(values, np.nan) for name, values in traces.columns.items()},
    )
