"""Residuals of the level, and what a balance, an area or a switch that is a little off makes of them."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.regimes import IDLE, START_RAMP, STOP_RAMP, Regimes, first_runs
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.level_noise import told_noise_m
from wetwell.sim2real.replay.observer import LEVEL_TIME_S, Observer, without_s
from wetwell.sim2real.replay.replay import Doubt, Prediction
from wetwell.sim2real.residuals.bins import LEVEL, NO_PUMP, Seconds, binned
from wetwell.sim2real.residuals.signals import UNRESOLVED, SignalResiduals, may_be_old, steps
from wetwell.sim2real.residuals.telemetry import Pattern

IDLE_LEVEL_BIN_S = 30
RAMP_LEVEL_BIN_S = 5
AREA_TOLERANCE = 0.015
"""Share by which a right area of the wet well may be off at some level: nobody draws ladders and benches."""
BALANCE_TOLERANCE = 0.004
"""Share of the rated flow by which a right balance may not close."""
LEAST_M = 1e-5
"""By which a right level is off in any case: pumps are followed in steps of a second. [m]"""
GAP_S, FORGOTTEN_S = 10, round(2.0 * LEVEL_TIME_S)
"""Time without rows in which pumps may have been switched unseen; time for which the level shows it then. [s]"""


class Sizes(NamedTuple):
    """(bins,) how far a right level may be off before it is corrected, and what is material of it. [m]."""

    off_m: Floats
    material_m: Floats


def level_residuals(
    traces: Traces,
    station: Station,
    regimes: Regimes,
    plain: Prediction,
    doubt: Doubt,
    patterns: Mapping[AnalogueQuantity, Pattern],
) -> SignalResiduals:
    """Of the level.

    Parameters
    ----------
    plain : Prediction
        Of the station as it is.
    doubt : Doubt
        What a right level may be off.
    """
    is_told, is_of_steps = np.isfinite(doubt.observer.level_m), doubt.observer.is_of_steps
    recorded_m = np.where(is_told, doubt.observer.level_m, traces.level_m)
    counted = np.isfinite(recorded_m)
    counted &= ~_after_gaps(traces.is_row) if doubt.level_m is None else np.isfinite(doubt.level_m)
    counted &= ~_has_no_past(traces, regimes)
    counted &= is_told if is_of_steps else np.cumsum(is_told) > 0  # of a level that is held, its first change
    regime = regimes.of_station
    is_ramp = (regime == START_RAMP) | (regime == STOP_RAMP)
    seconds = binned(counted, regime + 10 * regimes.cycle, np.where(is_ramp, RAMP_LEVEL_BIN_S, IDLE_LEVEL_BIN_S))
    noise_m2 = told_noise_m(traces, station, doubt.observer.level_m) ** 2 / seconds.counts
    if doubt.level_m is not None:
        noise_m2 = seconds.means_of(doubt.level_m[seconds.second] ** 2) / seconds.counts
    if traces.inflow_m3h is None:
        off_m, material_m = _followed(traces, station, seconds, plain, doubt.observer)
    else:
        off_m, material_m = _balanced(traces, station, seconds, plain, is_told)
    if doubt.level_m is not None:
        off_m = np.hypot(off_m, seconds.means_of(AREA_TOLERANCE * moved_m(traces, regime)[seconds.second]))

    deviation_m = np.sqrt(noise_m2 + off_m**2)
    return SignalResiduals(
        bins=seconds.bins(
            LEVEL,
            NO_PUMP,
            regime,
            regimes.cycle,
            deviation=deviation_m,
            floor=noise_m2 / deviation_m**2,
            tolerance=off_m / deviation_m,
            material=material_m / deviation_m,
        ),
        name="level_m",
        pump=NO_PUMP,
        seconds=seconds,
        recorded=recorded_m[seconds.second],
        is_old=may_be_old(traces, traces.level_m)[seconds.second],
        pattern=None if is_of_steps else patterns.get("level_m"),
    )


def _has_no_past(traces: Traces, regimes: Regimes) -> Flags:
    """(n,) whether a pump runs whose past nobody knows, or none has stopped yet of those of which that is so."""
    is_first = first_runs(traces, regimes)
    counts = is_first.any(axis=1)
    is_before = np.all(is_first[counts], axis=0) & counts.any()
    return np.asarray(is_before | np.any(is_first & (regimes.of_pumps != IDLE), axis=0), dtype=np.bool_)


def _balanced(traces: Traces, station: Station, seconds: Seconds, plain: Prediction, is_told: Flags) -> Sizes:
    """Where the inflow is measured: what the balance misses adds up for `LEVEL_TIME_S`, or from value to value."""
    materiality, area_m2 = station.materiality, station.sump.mean_area_m2
    open_s = seconds.means(np.maximum(LEVEL_TIME_S, without_s(is_told) + 1))
    carried_m = float(np.max(plain.plant.rated_flow_m3h)) / 3600.0 / area_m2 * open_s
    jumps_m3h = np.abs(np.diff(_pumped_m3h(traces, plain), prepend=0.0)) * steps(traces, plain)
    forgotten = UNRESOLVED[0] * np.exp(-np.arange(3.0 * LEVEL_TIME_S) / LEVEL_TIME_S)
    open_m = np.convolve(jumps_m3h, forgotten)[: traces.seconds] / 3600.0 / area_m2
    moved_m_s = np.abs(np.diff(plain.level_m, prepend=plain.level_m[:1]))  # before a value corrects it, not after
    late_m = materiality.time_s * seconds.means(moved_m_s)
    return Sizes(
        off_m=np.hypot(BALANCE_TOLERANCE * carried_m, seconds.means(open_m)),
        material_m=np.sqrt(materiality.level_m**2 + (materiality.flow_share * carried_m) ** 2 + late_m**2),
    )


def _followed(traces: Traces, station: Station, seconds: Seconds, plain: Prediction, observer: Observer) -> Sizes:
    """Where it is not: the observer takes for inflow what does not change, so that switches alone show it, briefly.

    Of each size that is material, the level shows what the observer leaves of it.
    """
    materiality = station.materiality
    carried_m_s = _pumped_m3h(traces, plain) / 3600.0 / station.sump.mean_area_m2
    jumps_m = np.asarray(UNRESOLVED[0] * np.diff(carried_m_s, prepend=0.0) * steps(traces, plain), dtype=np.float64)
    none = np.zeros(traces.seconds)

    def left_m(gained_m: Floats, misread_m: Floats) -> Floats:
        squares_m2 = seconds.means(observer.left_m(gained_m, misread_m) ** 2)
        return np.asarray(np.hypot(np.sqrt(squares_m2), LEAST_M), dtype=np.float64)

    of_balance_m = left_m(carried_m_s, none)
    return Sizes(
        off_m=np.hypot(np.hypot(BALANCE_TOLERANCE, AREA_TOLERANCE) * of_balance_m, left_m(jumps_m, none)),
        material_m=np.sqrt(
            (materiality.flow_share * of_balance_m) ** 2
            + left_m(none, np.where(carried_m_s > 0.0, materiality.level_m, 0.0)) ** 2
            + left_m(none, materiality.time_s * carried_m_s) ** 2
        ),
    )


def _pumped_m3h(traces: Traces, plain: Prediction) -> Floats:
    """(n,) flow of all pumps: of the meters if there are any, else the rated one while a pump runs. [m³/h]."""
    if "flow_m3h" in plain.signals:
        return np.asarray(plain.signals["flow_m3h"].sum(axis=0), dtype=np.float64)
    return np.asarray(plain.plant.rated_flow_m3h @ (traces.frequency_hz > 0.0), dtype=np.float64)


def _after_gaps(is_row: Flags) -> Flags:
    """(n,) whether rows were missing so lately that the observer of the level has not come back."""
    place = np.arange(is_row.size)
    last = np.maximum.accumulate(np.where(is_row, place, 0))
    ends = np.r_[False, place[1:] - last[:-1] > GAP_S] & is_row
    since_s = place - np.maximum.accumulate(np.where(ends, place, -FORGOTTEN_S))
    return np.asarray(since_s < FORGOTTEN_S)


def moved_m(traces: Traces, regime: Integers) -> Floats:
    """(n,) how far the level moves from value to value; 0 between rows. [m].

    In starts and stops it is the mean of all: how far it moved in one says when the pump was switched, and so does
    its error.
    """
    moved = np.zeros(traces.seconds)
    known = np.flatnonzero(np.isfinite(traces.level_m))
    moved[known[1:]] = np.abs(np.diff(traces.level_m[known]))
    for ramp in (START_RAMP, STOP_RAMP):
        rows = known[regime[known] == ramp]
        moved[rows] = moved[rows].mean() if rows.size else 0.0
    return moved
