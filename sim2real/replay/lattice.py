"""The lattice that the values of a channel lie on: steps of a sensor, and the finer ones of storage."""

import numpy as np

from wetwell.protocols.arrays import Flags, Floats

LATTICE_SHARE = 0.98
"""Share of the moves that are whole steps."""
STORED_STEPS = (0.01, 0.005, 0.001)
"""Steps in which a historian stores what came in coarser ones. [m]"""
COARSE = 1.25
"""Steps of storage that the sensor's step has at least: of a finer one nearly each level is stored. [1]"""
BY_CHANCE = 1e-3
"""Probability with which levels that lie anywhere may seem to be in steps. [1]"""
FINENESS = 0.05
"""Of the steps that are tried: how far they shift the last level, over the step of storage."""


def lattice(values: Floats) -> float:
    """Step of the lattice that values lie on, 0 without one; a coarse one may have been stored in finer steps."""
    levels = np.unique(np.round(values[np.isfinite(values)], 9))
    steps = np.diff(levels)
    levels, steps = levels[np.r_[True, steps > 1e-7]], steps[steps > 1e-7]
    if steps.size == 0 or levels.size > 0.2 * np.isfinite(values).sum():
        return 0.0
    step = float(np.median(steps[steps < 1.5 * steps.min()]))
    off = np.abs(steps / step - np.round(steps / step))
    if float(np.mean(off < 0.02)) > LATTICE_SHARE:
        is_stored = step < COARSE * _stored_step(levels)
        return (_coarse_step(levels, step) if is_stored else 0.0) or step
    return _coarse_step(levels, float(steps.min()))


def _coarse_step(levels: Floats, least: float) -> float:
    """Largest step that all levels lie on within half of the step in which they were stored, 0 without one.

    Each level has a place of its own. The finer the sensor's step is than two steps of storage, the more levels
    follow each other that are one apart. If levels were anywhere, hardly ever would all lie so near to those of one
    of the steps that are tried.
    """
    stored = _stored_step(levels)
    if stored == 0.0:
        return 0.0
    reach, run = float(levels[-1] - levels[0]), _longest_run(np.diff(levels) < COARSE * stored)
    longest = min(least + stored, (1.0 + 1.0 / run) * stored) if run else least + stored
    finest, near = FINENESS * stored * least / reach, (0.5 + FINENESS) * stored
    for step in np.arange(longest, max(least - stored, COARSE * stored), -finest):
        if reach / stored * (2.0 * near / step) ** levels.size > BY_CHANCE:
            break
        turns = np.exp(2j * np.pi * levels / step)
        off = np.angle(turns / np.mean(turns)) / (2.0 * np.pi) * step
        place = np.round((levels - off - levels[0] + off[0]) / step)
        if 0.5 * float(np.ptp(off)) < near and np.diff(place).min() > 0.0:
            return float(np.polyfit(place, levels, 1)[0])
    return 0.0


def _longest_run(flags: Flags) -> int:
    """Most flags in a row."""
    ends = np.flatnonzero(np.diff(np.r_[False, flags, False]))
    return int(np.max(ends[1::2] - ends[::2], initial=0))


def _stored_step(levels: Floats) -> float:
    """Largest power of ten, or half of one, of which all levels are multiples; 0 if there is none."""
    for step in STORED_STEPS:
        if float(np.max(np.abs(levels / step - np.round(levels / step)))) < 1e-3:
            return step
    return 0.0
