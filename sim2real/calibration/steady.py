"""Steady duties of a recording: means over rows in which nothing was switched, the raw material of calibration."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.recording.drives import STANDING_HZ

SEGMENT_S = 25.0
"""Time that a steady duty has to last, so that its mean is one. [s]"""
WARM_UP_S = 30.0
"""Time after a switch in which ramps and damped meters settle. [s]"""
RAMP_STEP = 0.005
"""A speed ratio that moves by more from one row to the next is a ramp, not a duty."""
SPEED_STEP = 0.02
"""Speed ratios that differ by less are one duty. [1]"""
LEVEL_STEP_M = 0.5
"""Levels that differ by less are one duty. [m]"""
FASTEST = 2.0
"""Speed ratio over which a frequency is taken for a wrong value: no drive turns a pump at twice its speed. [1]"""
GAP_STEPS = 3.0
"""A step of time that is longer than so many usual ones is a gap: what was switched in it nobody knows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Running:
    """Which pumps run, how fast, and in which rows nothing changes.

    Attributes
    ----------
    running : (pumps, n) bool array
    speed_ratio : (pumps, n) array
        Frequency over nominal frequency; 1 of a running pump without a frequency, 0 of one that stands.
    run : (pumps, n) int array
        Number of the run, from 1; 0 before the first.
    step_s : float
        Usual step from row to row. [s]
    time_s : (n,) array
        Since the first row. [s]
    """

    running: Flags
    speed_ratio: Floats
    run: Integers
    step_s: float
    time_s: Floats

    def is_steady(self, pumps: Flags) -> Flags:
        """(n,) whether none of these pumps has been switched or has changed its speed, in a row and beside it."""
        switched = self.switched(pumps)
        since_s = self.time_s - self.time_s[switched][np.cumsum(switched) - 1]
        speed = self.speed_ratio[pumps]
        steps = np.abs(np.diff(speed, axis=1, prepend=speed[:, :1], append=speed[:, -1:])).max(axis=0)
        beside = np.concatenate([switched[1:], [True]]) & (self.step_s > SEGMENT_S)
        steady: Flags = (np.maximum(steps[1:], steps[:-1]) < RAMP_STEP) & (since_s >= WARM_UP_S) & ~beside
        return steady

    def switched(self, pumps: Flags) -> Flags:
        """(n,) whether one of these pumps was switched since the row before, or a gap lies there."""
        running = self.running[pumps]
        gap = np.diff(self.time_s, prepend=self.time_s[:1]) > GAP_STEPS * self.step_s
        changed: Flags = np.any(np.diff(running, axis=1, prepend=~running[:, :1]), axis=0) | gap
        return changed


def running_flags(recording: Recording, pumps: int) -> Flags:
    """(pumps, n) whether each pump runs: from its flag, or else from its frequency."""
    flags = recording.of_pumps("running", pumps)
    frequency_hz = recording.of_pumps("frequency_hz", pumps)
    running: Flags = np.where(np.isnan(flags), frequency_hz >= STANDING_HZ, flags > 0.0)
    return running


def running_of(recording: Recording, station: Station) -> Running:
    """Which pumps run; times must rise. A row without flag and frequency counts as standing."""
    pumps = len(station.pump)
    running = running_flags(recording, pumps)
    nominal_hz = np.array([[pump.nominal_frequency_hz] for pump in station.pump])
    frequency_hz = recording.of_pumps("frequency_hz", pumps)
    is_known = np.isfinite(frequency_hz).any(axis=1, keepdims=True)
    speed = np.where(is_known, frequency_hz / nominal_hz, 1.0)
    speed[speed > FASTEST] = np.nan
    time_s = (recording.time_ns - recording.time_ns[:1]) / NS_PER_S
    starts = np.diff(running, axis=1, prepend=False) & running
    return Running(
        running=running,
        speed_ratio=np.where(running, speed, 0.0),
        run=np.cumsum(starts, axis=1),
        step_s=float(np.median(np.diff(time_s))) if time_s.size > 1 else 1.0,
        time_s=time_s,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyDuties:
    """Means over the steady rows of one duty: (n, pumps) of the pumps of a main; NaN is "not measured or standing".

    `run` numbers the runs of each pump; 0 of one that stands. `level_m` is (n,).
    """

    run: Integers
    speed_ratio: Floats
    level_m: Floats
    flow_m3h: Floats
    head_m: Floats
    power_kw: Floats

    def __len__(self) -> int:
        return int(self.level_m.size)


def steady_duties(recording: Recording, station: Station, running: Running, pumps: Flags) -> SteadyDuties:
    """Steady duties of the pumps of a main: rows between two switches whose speeds and level hardly differ.

    Parameters
    ----------
    recording : Recording
        Times rise.
    station : Station
    running : Running
        Of this recording.
    pumps : (pumps,) bool array
        Those of the main.
    """
    count = len(station.pump)
    some = running.running[pumps]
    speed = running.speed_ratio[pumps]
    level_m = recording.column("level_m")
    spell = np.cumsum(running.switched(pumps))
    rows = running.is_steady(pumps) & some.any(axis=0) & np.isfinite(speed).all(axis=0)
    bins = np.vstack([spell, np.rint(speed / SPEED_STEP), np.nan_to_num(np.rint(level_m / LEVEL_STEP_M), nan=-1e6)])
    _, first, where, counts = np.unique(
        bins[:, rows], axis=1, return_index=True, return_inverse=True, return_counts=True
    )
    where = where.ravel()
    lasting = counts * max(running.step_s, 1.0) >= SEGMENT_S

    def mean(values: Floats) -> Floats:
        known = np.isfinite(values[rows])
        sums = np.bincount(where, np.where(known, values[rows], 0.0), counts.size)
        number = np.bincount(where, known, counts.size)
        enough = 2 * number >= counts
        means: Floats = np.where(enough, sums / np.maximum(number, 1), np.nan)[lasting]
        return means

    def of_pumps(quantity: str) -> Floats:
        values = recording.of_pumps(quantity, count)[pumps]
        means = np.array(
            [mean(np.where(on & (value > 0.0), value, np.nan)) for value, on in zip(values, some, strict=True)]
        )
        return means.T

    return SteadyDuties(
        run=np.where(some, running.run[pumps], 0)[:, rows][:, first][:, lasting].T,
        speed_ratio=np.array([mean(values) for values in speed]).T,
        level_m=mean(level_m),
        flow_m3h=of_pumps("flow_m3h"),
        head_m=of_pumps("head_m"),
        power_kw=of_pumps("power_kw"),
    )
