"""Conditions into which only a crew brings a station: what a model has wrong there it may have right elsewhere."""

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.residuals.bins import NO_PUMP, Bins

USUAL = 0
"""Condition of a bin in which the controller was alone, or might have done the same."""
SAME_SPEED = 0.05
"""Speeds that differ by less, as shares of nominal, are one. [1]"""


def conditions_of(bins: Bins, traces: Traces, station: Station) -> Integers:
    """(bins,) number of the condition: speed of the pump, of all pumps for the level, and which valves are shut.

    Parameters
    ----------
    bins : Bins
    traces : Traces
    station : Station
    """
    hands = traces.by_hand
    if not hands.is_commanding.any():
        return np.full(bins.size, USUAL)
    nominal_hz = np.array([pump.nominal_frequency_hz for pump in station.pump])[:, None]
    ratio = traces.frequency_hz / nominal_hz
    slowed = np.where(ratio > 0.0, 1.0 - ratio, 0.0)
    of_station = _steps(slowed.sum(axis=0))
    of_pumps = _steps(slowed)
    second, pump = bins.second, bins.pump
    steps = np.where(pump == NO_PUMP, of_station[second], of_pumps[np.maximum(pump, 0), second])
    shut = 2 * hands.is_valve_shut[second] + hands.is_inlet_shut[second]
    return np.where(hands.is_commanding[second], 4 * steps + shut, USUAL)


def _steps(slowed: Floats) -> Integers:
    return np.rint(slowed / SAME_SPEED).astype(np.int64)
