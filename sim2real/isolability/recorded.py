"""Signals and duty points that occur in a recording."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import SIGNALS, SensedQuantity
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.isolability.duty_points import VALUES, DutyPoint
from wetwell.sim2real.recording.checks import check_pumps
from wetwell.simulator.parameters import PlantParameters

STATE_HZ = 1.0
"""Frequencies that differ by less are one state of the station. [Hz]"""
SETTLED_S = 30.0
"""After that long in a state its values are steady. [s]"""
MOST_CYCLES = 40
"""So many kinds of cycles are looked at, those that come most often."""

State = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stay:
    """Rows, one after the other, in one state."""

    state: State
    rows: slice


def recorded_signals(recording: Recording) -> tuple[SensedQuantity, ...]:
    """Quantities that have values which differ, at the station or at any pump."""
    known = []
    for quantity in SIGNALS.values():
        columns = [recording.column(quantity)] if quantity in ("level_m", "inflow_m3h") else []
        columns = columns or list(recording.of_pumps(quantity))
        if any(_moves(column) for column in columns):
            known.append(quantity)
    return tuple(known)


def recorded_points(recording: Recording, station: Station, plant: PlantParameters) -> tuple[DutyPoint, ...]:
    """Duty points of a recording: two states that follow each other are a cycle, each at its low and high levels.

    Parameters
    ----------
    recording : Recording
        Of the station; its times rise.
    station : Station
    plant : PlantParameters
        Of the station.

    Raises
    ------
    ValueError
        If the numbers of pumps differ, or there is no frequency and no running flag, or no steady state.
    """
    check_pumps(recording, station)
    frequency_hz = _frequencies_hz(recording, station)
    if not np.isfinite(frequency_hz).any():
        raise ValueError("neither frequencies nor running flags have values: no duty point can be told")
    every_s = float(np.median(np.diff(recording.time_ns))) / NS_PER_S if len(recording) > 1 else 1.0
    stays = _stays(frequency_hz, max(round(SETTLED_S / every_s), 0))
    if not stays:
        raise ValueError("no state lasts for two rows: nothing runs steadily")
    cycles: dict[tuple[State, State], list[tuple[_Stay, _Stay]]] = defaultdict(list)
    for one, other in zip(stays, stays[1:] or stays, strict=False):
        cycles[one.state, other.state].append((one, other))
    often = sorted(cycles.items(), key=lambda item: -len(item[1]))[:MOST_CYCLES]
    level_m, inflow_m3h = recording.column("level_m"), recording.column("inflow_m3h")
    points = []
    for cycle, (states, pairs) in enumerate(often):
        for place, state in enumerate(states):
            ours = np.concatenate([np.arange(len(recording))[pair[place].rows] for pair in pairs])
            stay_s = ours.size / len(pairs) * every_s
            points += [
                DutyPoint(
                    frequency_hz=state,
                    level_m=level,
                    inflow_m3h=_known_mean(inflow_m3h[ours], _carried_m3h(states, plant)),
                    cycle=cycle,
                    values=min(ours.size, VALUES),
                    visits=len(pairs),
                    stay_s=stay_s,
                    every_s=every_s,
                )
                for level in _levels_m(level_m[ours], station)
            ]
    return tuple(points)


def _frequencies_hz(recording: Recording, station: Station) -> Floats:
    """(pumps, n) frequencies; nominal ones where only the running flag is known."""
    nominal_hz = np.array([[pump.nominal_frequency_hz] for pump in station.pump])
    frequency_hz = recording.of_pumps("frequency_hz", len(station.pump))
    flags = recording.of_pumps("running", len(station.pump))
    return np.where(np.isnan(frequency_hz), flags * nominal_hz, frequency_hz)


def _stays(frequency_hz: Floats, settling_rows: int) -> list[_Stay]:
    """Rows in one state, at least two before the settling ones are taken off."""
    states = STATE_HZ * np.round(np.nan_to_num(frequency_hz) / STATE_HZ)
    first = np.flatnonzero(np.r_[True, np.any(states[:, 1:] != states[:, :-1], axis=0)])
    ends = np.r_[first[1:], states.shape[1]]
    return [
        _Stay(state=tuple(states[:, begin].tolist()), rows=slice(begin + settling_rows, end))
        for begin, end in zip(first.tolist(), ends.tolist(), strict=True)
        if end - begin >= max(2, settling_rows + 1)
    ]


def _levels_m(levels_m: Floats, station: Station) -> tuple[float, ...]:
    """Low and high level of rows; where none is known, the middle of the station."""
    known = levels_m[np.isfinite(levels_m)]
    if known.size == 0:
        return (station.middle_level_m,)
    low_m, high_m = np.quantile(known, [0.1, 0.9])
    return (float(low_m), float(high_m))


def _carried_m3h(states: tuple[State, State], plant: PlantParameters) -> float:
    """Inflow between what the pumps carry in two states, where no meter tells it. [m³/h]."""
    carried = [
        sum(pump.rated_flow_m3h for pump, running in zip(plant.pumps, state, strict=True) if running > 0.0)
        for state in states
    ]
    return 0.5 * sum(carried)


def _known_mean(values: Floats, otherwise: float) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else otherwise


def _moves(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size) and bool(np.ptp(known) > 0.0)
