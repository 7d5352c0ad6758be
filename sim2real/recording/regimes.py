"""What a station does in each second: idle, ramps, steady, several pumps; and its starts and stops."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.drives import MOVED_HZ
from wetwell.sim2real.recording.traces import Traces

Regime = Literal["idle", "start_ramp", "steady", "multi_pump", "stop_ramp"]
REGIMES: tuple[Regime, ...] = get_args(Regime)
IDLE, START_RAMP, STEADY, MULTI_PUMP, STOP_RAMP = range(5)

SETTLING_S = 20
"""Seconds after a ramp in which damped sensors, inertia and observers settle."""
FEWEST_CYCLES, TIME_PARTS = 4, 24
"""Cycles under which a station hardly ever stands still, and the parts of time that take their place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A command: the n-th pump starts, or the n-th running one stops; `second` is the last before."""

    second: int
    is_start: bool
    number: int
    pump: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Regimes:
    """Regimes, cycles and events of a recording.

    Attributes
    ----------
    of_station : (n,) array
        Index into `REGIMES`.
    of_pumps : (pumps, n) array
        Index into `REGIMES` of each pump; `IDLE` also where it stands and others run.
    cycle : (n,) array
        Counts up with every start of a pump while all others stand; parts of time where that hardly happens.
    events : tuple of Event
    """

    of_station: Integers
    of_pumps: Integers
    cycle: Integers
    events: tuple[Event, ...]


def regimes_of(traces: Traces, station: Station) -> Regimes:
    """Regimes of a recording, from its frequencies alone; a ramp where it is open whether it is one."""
    found = _regimes_of(traces.frequency_hz, station)
    for placement in traces.drives.placements if traces.span_s == 1 else ():
        other = _regimes_of(placement, station)
        for mine, its in ((found.of_station, other.of_station), (found.of_pumps, other.of_pumps)):
            is_ramp = (its == START_RAMP) | (its == STOP_RAMP)
            mine[is_ramp] = its[is_ramp]
    if traces.span_s > 1:
        order = (IDLE, STEADY, MULTI_PUMP, START_RAMP, STOP_RAMP)
        if traces.span_s > station.control.ramp_s + SETTLING_S:
            order = (IDLE, START_RAMP, STOP_RAMP, STEADY, MULTI_PUMP)
        for mine in (found.of_station, *found.of_pumps):
            mine[traces.is_row] = _of_intervals(mine, np.flatnonzero(traces.is_row), traces.span_s, order)
    return found


def first_runs(traces: Traces, regimes: Regimes) -> Flags:
    """(pumps, n) whether a pump has yet to end its first run since a recording, or a part of one, begins.

    Nobody knows how long it stood before, or since when it runs: what gathers in that time is another one than a
    replay takes it to be. Acts by hand count as they are, and so does a pump that hardly ever runs, or stops.
    """
    runs = regimes.of_pumps != IDLE
    is_begin = np.r_[True, np.diff(traces.part) != 0]
    begin, of_part = np.maximum.accumulate(np.where(is_begin, np.arange(is_begin.size), 0)), np.cumsum(is_begin) - 1
    ended = np.cumsum(np.c_[np.zeros(traces.pumps), runs[:, :-1] & ~runs[:, 1:]], axis=1)
    count = np.array([np.bincount(of_part, one) for one in np.diff(ended, axis=1, append=ended[:, -1:])])
    by_hand = np.bincount(of_part, traces.by_hand.is_commanding) > 0.0
    is_first = (ended == ended[:, begin]) & (count >= FEWEST_CYCLES)[:, of_part] & ~by_hand[of_part]
    return np.asarray(is_first, dtype=np.bool_)


def _of_intervals(regime: Integers, last: Integers, span_s: int, order: tuple[int, ...]) -> Integers:
    """(rows,) the last in an order of the regimes that an interval meets."""
    rank = np.argsort(order)[regime]
    return np.array([order[int(rank[max(k - span_s + 1, 0) : k + 1].max())] for k in last], dtype=np.int64)


def _regimes_of(frequency_hz: Floats, station: Station) -> Regimes:
    running = frequency_hz > 0.0
    commanded = np.array([_commanded(hz, station.control.min_frequency_hz) for hz in frequency_hz])
    ramp_s = round(station.control.ramp_s) + SETTLING_S
    of_pumps = np.full(running.shape, IDLE, dtype=np.int64)
    together = running.sum(axis=0) > 1
    for i in range(running.shape[0]):
        of_pumps[i][running[i]] = STEADY
        of_pumps[i][running[i] & together] = MULTI_PUMP
        _mark(of_pumps[i], _rises(commanded[i]), ramp_s, START_RAMP)
        _mark(of_pumps[i], _falls(commanded[i]), 2 * ramp_s, STOP_RAMP, ends=_rises(commanded[i]))
    of_station = np.full(running.shape[1], IDLE, dtype=np.int64)
    of_station[running.any(axis=0)] = STEADY
    of_station[together] = MULTI_PUMP
    switches = np.sort(np.concatenate([np.r_[_rises(c), _falls(c)] for c in commanded]))
    for i in range(running.shape[0]):
        _mark(of_station, _rises(commanded[i]), ramp_s, START_RAMP, ends=switches)
        _mark(of_station, _falls(commanded[i]), ramp_s, STOP_RAMP, ends=switches)
    any_running = np.asarray(running.any(axis=0))
    cycle = np.cumsum(np.r_[False, any_running[1:] & ~any_running[:-1]])
    if cycle[-1] < FEWEST_CYCLES:
        cycle = np.arange(cycle.size) * TIME_PARTS // cycle.size
    return Regimes(of_station=of_station, of_pumps=of_pumps, cycle=cycle, events=_events(commanded))


def _commanded(frequency_hz: Floats, min_frequency_hz: float) -> Flags:
    """Whether a drive is commanded: it runs, and is not on its last way down."""
    commanded = frequency_hz > 0.0
    for end in np.flatnonzero(commanded[:-1] & ~commanded[1:]):
        k = end
        while k > 0 and (
            frequency_hz[k - 1] > frequency_hz[k] + MOVED_HZ
            or (0.0 < frequency_hz[k - 1] <= min_frequency_hz + MOVED_HZ and frequency_hz[k] <= frequency_hz[k - 1])
        ):
            k -= 1
        commanded[k + 1 : end + 1] = False
    return commanded


def _rises(flags: Flags) -> Integers:
    return np.flatnonzero(flags[1:] & ~flags[:-1]) + 1


def _falls(flags: Flags) -> Integers:
    return np.flatnonzero(~flags[1:] & flags[:-1]) + 1


def _mark(regime: Integers, begins: Integers, length_s: int, code: int, ends: Integers | None = None) -> None:
    """Set a regime for a time from each beginning on, or to the next of `ends`."""
    for begin in begins:
        end = begin + length_s
        if ends is not None:
            after = ends[np.searchsorted(ends, begin + 1) :]
            end = min(end, int(after[0])) if after.size else end
        regime[begin:end] = code


def _events(commanded: Flags) -> tuple[Event, ...]:
    """Single commands; two in one second tell nothing of their levels."""
    number = commanded.sum(axis=0)
    change = np.diff(commanded.astype(np.int64), axis=1)
    seconds = np.flatnonzero(np.abs(change).sum(axis=0) == 1)
    events = []
    for second in seconds:
        pump = int(np.flatnonzero(change[:, second])[0])
        is_start = bool(change[pump, second] > 0)
        events.append(
            Event(second=int(second), is_start=is_start, number=int(number[second]) + int(is_start), pump=pump)
        )
    return tuple(events)
