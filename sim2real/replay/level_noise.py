"""How noisy a level is, and whether it is rounded so that its noise does not show."""

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.seconds import noise_by_bends
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.lattice import lattice
from wetwell.sim2real.replay.steps import steps_m

MIN_NOISE_M = 1e-4
"""Standard deviation of a level sensor at the least: a reading without any noise is rounded. [m]"""
REPEATED = 0.5
"""Share of values that are the one before, from which steps are coarse. [1]

Where the noise has a standard deviation of half a step it is .49, and errors of rounding are as good as noise [1]_.

References
----------
.. [1] B. Widrow, I. Kollár, Quantization Noise, Cambridge 2008.
"""


def told_by_steps_m(traces: Traces) -> Floats | None:
    """(n,) levels in the seconds in which a rounded one passes from step to step, NaN elsewhere; None of others.

    Others have steps so fine that noise hides them, or move by several steps at a time, as held ones do. [m].
    """
    moves_m = np.abs(np.diff(traces.level_m[np.isfinite(traces.level_m)]))
    if not traces.is_each_second or traces.value != "instant" or np.sum(moves_m == 0.0) <= REPEATED * moves_m.size:
        return None
    step_m = lattice(traces.level_m)
    is_rounded = step_m > 0.0 and np.median(moves_m[moves_m > 0.0]) < 1.5 * step_m
    return steps_m(traces.level_m) if is_rounded else None


def level_noise_m(traces: Traces, station: Station) -> float:
    """Standard deviation of the level sensor's noise, from rows between which nothing is switched. [m]."""
    level_m = traces.level_m
    if not traces.is_each_second:
        moved = np.any(np.diff(traces.frequency_hz, axis=1, prepend=traces.frequency_hz[:, :1]) != 0.0, axis=0)
        moves = np.cumsum(moved)[traces.is_row]
        level_m = level_m[traces.is_row]
    bends = np.diff(level_m, n=2)
    if not traces.is_each_second:
        bends = bends[moves[2:] == moves[:-2]]
    seen_m = noise_by_bends(bends[np.isfinite(bends)])
    return max(seen_m, least_noise_m(station))


def told_noise_m(traces: Traces, station: Station, level_m: Floats) -> float:
    """The same of values that come where they change: by how far each is off the line between its neighbours. [m].

    Parameters
    ----------
    level_m : (n,) array
        NaN where there is none.
    """
    if level_m is traces.level_m:
        return level_noise_m(traces, station)
    second = np.flatnonzero(np.isfinite(level_m))
    gaps_s = np.diff(second).astype(np.float64)
    share = gaps_s[:-1] / (gaps_s[:-1] + gaps_s[1:])
    told_m = level_m[second]
    off_m = told_m[1:-1] - (1.0 - share) * told_m[:-2] - share * told_m[2:]
    bends = off_m * np.sqrt(6.0 / (1.0 + share**2 + (1.0 - share) ** 2))
    return max(noise_by_bends(bends), least_noise_m(station))


def least_noise_m(station: Station) -> float:
    """What a level sensor has at the least, whatever its rows show: half of what the station file says. [m]."""
    return max(0.5 * station.sensors.level_noise_m, MIN_NOISE_M)
