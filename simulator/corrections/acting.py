"""Learnt corrections at work: the covariates of a second, and what they add to each term."""

from wetwell.protocols.jit import inlined
from wetwell.simulator.corrections.parts import (
    ALL,
    BACK_FLOW,
    COLUMN,
    DAY_OF_WEEK,
    DAYS,
    FLOW_COVARIATE,
    HEAD_LOSS,
    HOUR_OF_DAY,
    IDLE_BEFORE,
    INERTIA,
    LEVEL_BALANCE,
    LEVEL_COVARIATE,
    SINCE_START,
    SPEED_COVARIATE,
    shape_at,
)
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.parameters import PlantRecords
from wetwell.simulator.state import PlantState

DAY_S = 86_400.0
FIRST_MONDAY_D = 4.0
"""Days from the beginning of 1970, a Thursday, to the first Monday."""


@inlined
def correct(plant: PlantRecords, state: PlantState, forcing: Forcing, second: int, level_m: float) -> None:
    """Set what is added to each term, (terms, pumps), for a second; covariates of flow are those of the one before.

    A term of the station as a whole (balance and reading of the level, area) has the same value for each pump.
    """
    _note_runs(plant, state)
    added = state.correction
    for term in range(added.shape[0]):
        for i in range(state.pumps.size):
            added[term, i] = 0.0
    for k in range(plant.corrections.size):
        part = plant.corrections[k]
        for i in range(state.pumps.size):
            if part.pump not in (ALL, i) or part.main not in (ALL, plant.pumps[i].main):
                continue
            if part.term < BACK_FLOW and not _is_used(part.term, i, plant, state):
                continue
            value = _covariate(part.covariate, part.column, part.term, i, plant, state, forcing, second, level_m)
            shape = shape_at(part.shape, value, part.centre, part.scale, part.low, part.high)
            added[part.term, i] += part.size * shape


@inlined
def _is_seen(j: int, i: int, term: int, plant: PlantRecords) -> bool:
    """Whether pump j counts for a term at pump i: all do for the station, those of its header for a pipe."""
    if term >= LEVEL_BALANCE or i == j:
        return True
    main = plant.pumps[i].main
    return term <= INERTIA and plant.pumps[j].main == main and plant.mains[main].is_common_header


@inlined
def _is_used(term: int, i: int, plant: PlantRecords, state: PlantState) -> bool:
    """Whether a pump that counts for a term at pump i turns, or water moves in it."""
    for j in range(state.pumps.size):
        pump = state.pumps[j]
        if (pump.frequency_hz > 0.0 or pump.shaft_ratio > 0.0 or state.mean_flow_m3h[j] > 0.0) and _is_seen(
            j, i, term, plant
        ):
            return True
    return False


@inlined
def _covariate(
    covariate: int,
    column: int,
    term: int,
    i: int,
    plant: PlantRecords,
    state: PlantState,
    forcing: Forcing,
    second: int,
    level_m: float,
) -> float:
    """Value of a covariate for a term at pump i."""
    value = level_m
    days = forcing.clock_s[second] / DAY_S
    if covariate == COLUMN:
        value = forcing.columns[column, second]
    elif covariate == HOUR_OF_DAY:
        value = (days % 1.0) * 24.0
    elif covariate == DAY_OF_WEEK:
        value = (days - FIRST_MONDAY_D) % 7.0
    elif covariate == DAYS:
        value = days
    elif covariate != LEVEL_COVARIATE:
        value = _of_pumps(covariate, term, i, plant, state)
    return value


@inlined
def _of_pumps(covariate: int, term: int, i: int, plant: PlantRecords, state: PlantState) -> float:
    """Value of a covariate that is of a pump, or of all on its header, or of all of a station."""
    flow_m3h = fastest = longest_s = count = 0.0
    idle_s = state.pumps[i].idle_before_s
    for j in range(state.pumps.size):
        pump = state.pumps[j]
        if pump.frequency_hz > 0.0 and plant.pumps[j].main == plant.pumps[i].main:
            count += 1.0
        if _is_seen(j, i, term, plant):
            flow_m3h += state.mean_flow_m3h[j]
            fastest = max(fastest, pump.frequency_hz / plant.pumps[j].nominal_frequency_hz)
            if pump.turned_s > longest_s:
                longest_s, idle_s = pump.turned_s, pump.idle_before_s
    value = count
    if covariate == FLOW_COVARIATE:
        value = flow_m3h
    elif covariate == SPEED_COVARIATE:
        value = fastest
    elif covariate == SINCE_START:
        value = longest_s
    elif covariate == IDLE_BEFORE:
        value = idle_s
    return value


@inlined
def _note_runs(plant: PlantRecords, state: PlantState) -> None:
    """Count the seconds of runs, and those for which nothing had moved in the pipe before them."""
    pumps = state.pumps
    for i in range(pumps.size):
        if pumps[i].frequency_hz > 0.0 and pumps[i].turned_s == 0.0:
            idle_s = pumps[i].rested_s
            for j in range(pumps.size):
                if _is_seen(j, i, HEAD_LOSS, plant):
                    idle_s = min(idle_s, pumps[j].idle_before_s if pumps[j].turned_s > 0.0 else pumps[j].rested_s)
            pumps[i].idle_before_s = idle_s
    for i in range(pumps.size):
        if pumps[i].frequency_hz > 0.0:
            pumps[i].turned_s += 1.0
            pumps[i].rested_s = 0.0
        else:
            pumps[i].turned_s = 0.0
            pumps[i].rested_s += 1.0
            pumps[i].idle_before_s = pumps[i].rested_s
