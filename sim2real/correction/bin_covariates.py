"""What each bin of a recording could go with: level, flow, speed, times, hours, pumps, columns of a user."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.recording.column_noise import course_of, noise_of
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.residuals.bins import NO_PUMP, Bins
from wetwell.simulator.corrections.acting import DAY_S, FIRST_MONDAY_D
from wetwell.simulator.corrections.parts import Column, Covariate
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.state import LONG_REST_S

LEAST_ERRORS = 0.01
"""Share of its variance from which a column's errors are worth taking off: slopes are too small by that. [1]"""


class Place(NamedTuple):
    """A covariate; of a user's column its name, and the standard deviation of the errors that are taken off."""

    covariate: Covariate
    column: str | None = None
    noise: float = 0.0


def bin_covariates(
    traces: Traces, bins: Bins, plant: PlantParameters, level_m: Floats, flow_m3h: Floats
) -> dict[Place, Floats]:
    """(bins,) values of each covariate, as the simulator sees it: modelled level and flow carry no noise of a sensor.

    A column of a user that may err is there twice: as it is, and without its errors.

    A bin of a pump has its own flow and times, or those of its common header; one of the level those of the station.

    Parameters
    ----------
    traces : Traces
    bins : Bins
    plant : PlantParameters
    level_m, flow_m3h : (n,) and (pumps, n) arrays
        As the replay has them. [m, m³/h]
    """
    second, clock_s = bins.second, traces.clock_s[bins.second]
    running = traces.frequency_hz > 0.0
    nominal_hz = np.array([pump.nominal_frequency_hz for pump in plant.pumps])
    main = np.array([pump.main for pump in plant.pumps])
    found: dict[Place, Floats] = {
        Place("level_m"): level_m[second],
        Place("hour_of_day"): clock_s % DAY_S / 3600.0,
        Place("day_of_week"): (clock_s / DAY_S - FIRST_MONDAY_D) % 7.0,
        Place("days"): clock_s / DAY_S,
    }
    own: Mapping[Covariate, Floats] = {
        name: np.zeros(bins.size)
        for name in ("flow_m3h", "speed_ratio", "since_start_s", "idle_before_s", "pumps_on_main")
    }
    for pump in np.unique(bins.pump):
        rows = np.flatnonzero(bins.pump == pump)
        seen = np.ones(main.size, dtype=np.bool_)
        if pump != NO_PUMP:
            is_header = plant.mains[main[pump]].is_common_header
            seen = (main == main[pump]) if is_header else (np.arange(main.size) == pump)
        at = second[rows]
        since_s, idle_s = _times(running[seen])
        own["flow_m3h"][rows] = flow_m3h[seen].sum(axis=0)[at]
        own["speed_ratio"][rows] = (traces.frequency_hz[seen] / nominal_hz[seen, None]).max(axis=0)[at]
        own["since_start_s"][rows], own["idle_before_s"][rows] = since_s[at], idle_s[at]
        beside = running if pump == NO_PUMP else running[main == main[pump]]
        own["pumps_on_main"][rows] = beside.sum(axis=0)[at]
    found |= {Place(name): values for name, values in own.items()}
    for name, course in traces.columns.items():
        found[Place("column", name)] = course[second]
        noise = noise_of(traces, name)
        if noise**2 > LEAST_ERRORS * np.nanvar(course):
            found[Place("column", name, noise)] = course_of(traces, Column(name=name, noise=noise))[second]
    return found


def _times(running: Flags) -> tuple[Floats, Floats]:
    """(n,) seconds since the longest run began, and for which nothing had run before it; of (pumps, n) flags.

    Before the recording all have rested for long, as in the simulator.
    """
    place = np.arange(running.shape[1])
    since = np.max([np.where(one, place - _last(~one, place), 0) for one in running], axis=0)
    any_running = np.asarray(running.any(axis=0))
    last = _last(any_running, place)
    stood = np.where(any_running, 0.0, np.where(last < 0, LONG_REST_S, 0.0) + place - last)
    begins = np.maximum.accumulate(np.where(any_running & ~np.r_[False, any_running[:-1]], place, 0))
    idle = np.where(any_running, np.r_[LONG_REST_S, stood[:-1]][begins], stood)
    return since.astype(np.float64), idle.astype(np.float64)


def _last(flags: Flags, place: Integers) -> Integers:
    """(n,) last place at which a flag was set; -1 before the first."""
    return np.asarray(np.maximum.accumulate(np.where(flags, place, -1)))
