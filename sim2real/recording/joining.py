"""Several recordings of a station as one: one after the other, with nothing between them."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import PUMP_METERS
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.recording.by_hand import joined_hands
from wetwell.sim2real.recording.drives import Drives
from wetwell.sim2real.recording.excerpt import with_blanks
from wetwell.sim2real.recording.traces import Traces

SAME_RATE = 1.05
"""Ratio of the times from row to row up to which two recordings have one rate."""


def joined(recordings: Sequence[Traces]) -> Traces:
    """Traces of several recordings, in the order of their times.

    A run of a pump that one of them begins or ends with is left out. A signal that one lacks has no values there. The
    inflow counts as measured where all of them have it.

    Parameters
    ----------
    recordings : sequence of Traces
        Of one station, at least one.

    Raises
    ------
    ValueError
        If they have other rates, or values that stand for something else, or overlap in time.
    """
    parts = sorted(recordings, key=lambda part: part.start_ns)
    first = parts[0]
    if len(parts) == 1:
        return first
    for one, other in pairwise(parts):
        if max(one.rate_s, other.rate_s) > SAME_RATE * min(one.rate_s, other.rate_s):
            raise ValueError(f"recordings of one rate are needed, got {one.rate_s:g} s and {other.rate_s:g} s")
        if one.value != other.value:
            raise ValueError(f"recordings of one kind of value are needed, got '{one.value}' and '{other.value}'")
        if one.start_ns + float(one.time_s[-1]) * NS_PER_S >= other.start_ns:
            raise ValueError("two recordings overlap in time: give each second once")

    def put(values: Callable[[Traces], Floats]) -> Floats:
        return np.concatenate([values(part) for part in parts], axis=-1)

    inflow_m3h = [part.inflow_m3h for part in parts if part.inflow_m3h is not None]
    placements = zip(*(part.drives.placements for part in parts), strict=False)  # none where one has no open moment
    measured = [name for name in PUMP_METERS if any(name in part.signals for part in parts)]
    begins = np.cumsum([0, *(part.seconds for part in parts[:-1])])
    together = Traces(
        start_ns=first.start_ns,
        rate_s=first.rate_s,
        value=first.value,
        time_s=put(lambda part: part.time_s + (part.start_ns - first.start_ns) / NS_PER_S),
        is_row=np.concatenate([part.is_row for part in parts]),
        drives=Drives(
            frequency_hz=put(lambda part: part.frequency_hz),
            placements=tuple(np.concatenate(each, axis=-1) for each in placements),
            open_s=put(lambda part: part.drives.open_s),
        ),
        level_m=put(lambda part: part.level_m),
        inflow_m3h=np.concatenate(inflow_m3h) if len(inflow_m3h) == len(parts) else None,
        signals={
            name: np.concatenate(
                [part.signals.get(name, np.full(part.frequency_hz.shape, np.nan)) for part in parts], axis=-1
            )
            for name in measured
        },
        columns={
            name: np.concatenate([part.columns.get(name, np.full(part.seconds, np.nan)) for part in parts])
            for name in {name: None for part in parts for name in part.columns}
        },
        by_hand=joined_hands([part.by_hand for part in parts]),
        part=np.repeat(np.arange(len(parts)), [part.seconds for part in parts]),
    )
    return with_blanks(together, [begin + _whole_runs(part) for part, begin in zip(parts, begins, strict=True)])


def _whole_runs(part: Traces) -> Integers:
    """Seconds from the first to the last in which no pump runs: no run is cut; all where some pump always does."""
    idle = np.flatnonzero(~np.any(part.frequency_hz > 0.0, axis=0))
    return np.arange(idle[0], idle[-1] + 1) if idle.size else np.arange(part.seconds)
