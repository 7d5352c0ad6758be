"""Whether the rows of an export look like means: what a pump shows in the row of its start tells."""

from collections.abc import Iterable

import numpy as np

from wetwell.protocols.arrays import Floats

_STANDS = 0.02
"""Share of its greatest value under which a pump stands. [1]"""
_WHOLE = 0.9
"""Share of the next row under which the row of a start holds a part of it. [1]"""
_MOSTLY = 0.75
"""Share of starts that begin with such a row: 9 in 10 of means, about ramp over step of instants. [1]"""
_STARTS = 10
"""Starts from which on that is told."""
_STEP_S = 30.0
"""Rows that are closer than that see ramps, in instants as well. [s]"""


def looks_like_means(values: Iterable[Floats], step_s: float) -> bool:
    """Whether flows, speeds or powers of pumps are means of the time between rows.

    A start falls anywhere between two rows. A mean then has a part of what the next one has; an instant has all of
    it, or nothing, but for the few that fall into the ramp.

    Parameters
    ----------
    values : iterable of (n,) arrays
        In order of time, each of a pump.
    step_s : float
        From row to row. [s]

    Examples
    --------
    >>> run = np.array([0.0, 0.0, 31.0, 50.0, 50.0])
    >>> looks_like_means([np.tile(run, 10)], 60.0), looks_like_means([np.tile(run[[0, 1, 3, 4]], 10)], 60.0)
    (True, False)
    """
    if step_s < _STEP_S:
        return False
    starts, parts = 0, 0
    for series in values:
        known = series[np.isfinite(series)]
        stands = known <= _STANDS * np.max(known, initial=0.0)
        begins = np.flatnonzero(stands[:-2] & ~stands[1:-1] & ~stands[2:]) + 1
        starts += begins.size
        parts += int(np.count_nonzero(known[begins] < _WHOLE * known[begins + 1]))
    return starts >= _STARTS and parts >= _MOSTLY * starts
