"""How far a level falls while no pump runs: no inflow does that, whatever it is."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.likelihood.cells import Block
from wetwell.sim2real.recording.regimes import IDLE, REGIMES, Regimes
from wetwell.sim2real.recording.seconds import since_changes
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.level_noise import level_noise_m
from wetwell.sim2real.residuals.bins import LEVEL
from wetwell.sim2real.residuals.telemetry import Pattern

MEAN_S = 10
"""Of which means are taken: water swings to and fro in a wet well of some metres within two or three seconds. [s]"""
FAR = 3.0
"""Standard deviations from which a fall is told. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Falls:
    """Falls at rest, one of each rest: `left_m` (k,), and the block that they are, in metres."""

    left_m: Floats
    block: Block

    @property
    def far_m(self) -> float:
        """The largest one that is far beyond noise and what is allowed, 0 without any. [m]."""
        is_far = self.left_m**2 > FAR**2 * (self.block.variance + self.block.allowed**2)
        return float(np.max(self.left_m[is_far], initial=0.0))


def falls_at_rest(traces: Traces, station: Station, regimes: Regimes, patterns: Collection[Pattern]) -> Falls | None:
    r"""The largest fall of the level in each rest of the station, once it has risen; None without two rests.

    $$f = \max_{i < j} \left(\bar L_i - \bar L_j\right)$$

    of means over `MEAN_S`. A right model leaves none of it: an inflow is not negative, and what runs back
    through a check valve lets the level rise. A late level falls on after a stop, and under a late frequency it falls
    before a start. So a rest counts from where the level has risen by more than is allowed, to its last peak. Allowed
    is what is material at either end. The largest of n differences of noise is about $\sigma \sqrt{4 \ln n}$. A rest
    with which a recording begins does not count: what was before it nobody knows.

    Parameters
    ----------
    traces : Traces
    station : Station
    regimes : Regimes
    patterns : collection of Pattern
        Steps and deadbands of the level are no falls.
    """
    steps_m = [max(one.quantum, one.deadband) for one in patterns if one.quantity == "level_m"]
    allowed_m = float(np.hypot(2.0 * station.materiality.level_m, max(steps_m, default=0.0)))
    noise_m2 = level_noise_m(traces, station) ** 2
    rest = np.cumsum(since_changes(regimes.of_station + len(REGIMES) * traces.part) == 0)
    has_no_past = np.isin(rest, rest[since_changes(traces.part) == 0])
    counts = (regimes.of_station == IDLE) & np.isfinite(traces.level_m) & ~has_no_past
    if station.sump.overflow_level_m is not None:
        counts &= traces.level_m < station.sump.overflow_level_m
    found = []
    seconds = np.flatnonzero(counts)
    for one in np.split(seconds, np.flatnonzero(np.diff(rest[seconds])) + 1) if seconds.size else []:
        means_m, of_noise = _means(one, traces.level_m)
        if means_m.size > 1:
            found.append((_fall_m(means_m, allowed_m), 4.0 * np.log(means_m.size) * of_noise * noise_m2))
    if len(found) < 2:
        return None
    left_m, variance_m2 = np.array(found).T
    rests = np.arange(left_m.size)
    block = Block(
        signal=LEVEL,
        regime=IDLE,
        rows=rests,
        group=np.zeros_like(rests),
        cycle=rests,
        variance=variance_m2,
        allowed=np.full(rests.size, allowed_m),
        of_inflow=variance_m2,
        surges=(0.0,),
        may_rain=False,
        may_jump=False,
        in_storm=np.zeros(rests.size, dtype=np.bool_),
        span=np.zeros(1, dtype=np.int64),
    )
    return Falls(left_m=left_m, block=block)


def _means(seconds: Integers, level_m: Floats) -> tuple[Floats, float]:
    """(k,) means over `MEAN_S` each, from the seconds of a rest with a value, and the share of noise in them."""
    part = (seconds - seconds[0]) // MEAN_S
    counts = np.bincount(part)
    is_told = counts > 0
    return (np.bincount(part, level_m[seconds])[is_told] / counts[is_told]), float(np.mean(1.0 / counts[is_told]))


def _fall_m(means_m: Floats, allowed_m: float) -> float:
    """Largest fall of some means after they have risen and up to their last peak; 0 where they never fall."""
    has_risen = means_m > np.minimum.accumulate(means_m) + allowed_m
    peaks_m = np.maximum.accumulate(means_m[::-1])[::-1]
    is_before = means_m < peaks_m - allowed_m
    if not (has_risen.any() and is_before.any()):
        return 0.0
    before = int(np.flatnonzero(is_before)[-1])
    peak = before + int(np.argmax(means_m[before:]))
    between_m = means_m[int(np.argmax(has_risen)) : peak + 1]
    return float(np.max(np.maximum.accumulate(between_m) - between_m, initial=0.0))
