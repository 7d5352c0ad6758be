"""Duty points at which a station is looked at: those that its control reaches, in cycles that share an inflow."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from wetwell.protocols.station.station_file import Station
from wetwell.simulator.parameters import PlantParameters

VALUES = 100
"""Independent values of a signal at a duty point at the most; more would make more of the model than it is worth."""
VISITS = 25
"""How often a duty point is met in a recording of some days."""
STAY_S = 100.0
"""How long a station usually stays there. [s]"""
MOVING = 1.1
"""Shut-off head over the static head at the lowest speed that is looked at. [1]"""
MOST_PUMPS = 2
"""Pumps of a main that run at once at the most: what three tell more than two is little."""
UNKNOWN_LEVEL_M = 1.0
"""About where the level is of a station whose file knows no level at all. [m]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyPoint:
    """Where a station stays for a while.

    Attributes
    ----------
    frequency_hz : tuple of float
        Of each pump; 0 stands. [Hz]
    level_m : float
        [m]
    inflow_m3h : float
        About what flows in. [m³/h]
    cycle : int
        Points of one cycle follow each other so soon that they have the same inflow.
    values : int
        Independent values of each signal, over all visits.
    visits : int
        How often it was met, each time with another inflow.
    stay_s : float
        How long a visit lasts. [s]
    every_s : float
        Seconds from value to value. [s]
    """

    frequency_hz: tuple[float, ...]
    level_m: float
    inflow_m3h: float
    cycle: int
    values: int = VALUES
    visits: int = VISITS
    stay_s: float = STAY_S
    every_s: float = 1.0


def control_points(station: Station, plant: PlantParameters) -> tuple[DutyPoint, ...]:
    """Duty points that the control of a station reaches.

    In a cycle one pump more runs or stands, at both levels between which it works, and the inflow lies between
    what the pumps carry with it and without it. Each pump of a main takes its turn, with up to one beside it. Pumps
    with a fixed speed run at the nominal one; with a level controller, or one that nobody knows, also at a speed
    half way down to where no water would move.

    Parameters
    ----------
    station : Station
    plant : PlantParameters
        Of the station.
    """
    points: list[DutyPoint] = []
    count = len(plant.pumps)
    for main in range(len(station.mains)):
        ours = [i for i in range(count) if station.main_of_pump[i] == main and plant.pumps[i].is_automatic]
        for cycle, (running, ratio) in enumerate(_cycles(station, plant, ours), start=len(points)):
            carried_m3h = (
                sum(plant.pumps[i].rated_flow_m3h for i in running) - 0.5 * plant.pumps[running[-1]].rated_flow_m3h
            )
            for pumps in (running[:-1], running):
                frequency_hz = tuple(
                    ratio * plant.pumps[i].nominal_frequency_hz if i in pumps else 0.0 for i in range(count)
                )
                points += [
                    DutyPoint(frequency_hz=frequency_hz, level_m=level_m, inflow_m3h=ratio * carried_m3h, cycle=cycle)
                    for level_m in _levels_m(station, len(running))
                ]
    return tuple(points)


def _cycles(station: Station, plant: PlantParameters, ours: Sequence[int]) -> Iterator[tuple[tuple[int, ...], float]]:
    """Running pumps of each cycle, and their speed ratio."""
    levels = len(ours) if station.control.is_external else len(station.control.start_levels_m)
    for size in range(1, min(len(ours), levels, MOST_PUMPS) + 1):
        turns = len(ours) if size < len(ours) else 1
        for turn in range(turns):
            running = tuple(ours[(turn + k) % len(ours)] for k in range(size))
            for ratio in _speed_ratios(station, plant, running):
                yield running, ratio


def _speed_ratios(station: Station, plant: PlantParameters, running: Sequence[int]) -> tuple[float, ...]:
    if station.control.mode == "on_off":
        return (1.0,)
    lowest = 0.0
    for i in running:
        static_m = max(plant.main_of(i).static_head_at_m(station.middle_level_m), 0.0)
        slowest = station.control.min_frequency_hz / plant.pumps[i].nominal_frequency_hz
        lowest = max(lowest, slowest, math.sqrt(MOVING * static_m / plant.pumps[i].c0))
    return (1.0, 0.5 * (1.0 + min(lowest, 1.0)))


def _levels_m(station: Station, running: int) -> tuple[float, float]:
    control = station.control
    if not control.is_external:
        return control.stop_levels_m[running - 1], control.start_levels_m[running - 1]
    middle_m = station.middle_level_m or UNKNOWN_LEVEL_M
    half_m = 0.5 * (middle_m - station.sump.floor_level_m)
    return middle_m - half_m, middle_m + half_m
