"""Weigh acts for a diagnosis on disk: reads, and nothing else."""

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.orders import Step
from wetwell.protocols.station.costs import Costs
from wetwell.protocols.station.station_file import Station
from wetwell.services.batch.gap.diagnosis import LEFT_OPEN
from wetwell.sim2real.experiments.left_open import LeftOpen
from wetwell.sim2real.experiments.proposals import proposals_of
from wetwell.sim2real.experiments.reported import ProposedAct, proposed_acts, refused_acts

EXPERIMENTS_SCHEMA = "wetwell.gap-experiments/1"
THREADS = min(os.cpu_count() or 1, 4)
"""Acts are weighed side by side: what is compiled holds no lock."""


def experiments_of(
    diagnosis: Path, *, prices: Station | None = None, inflow_m3h: float | None = None, seed: int = 0
) -> dict[str, Any]:
    """Acts that tell apart what a diagnosis leaves, best first.

    Parameters
    ----------
    diagnosis : Path
        Folder that `wetwell gap diagnose` wrote.
    prices : Station, optional
        Whose `[costs]` and `[control]` count instead of those at the time of the diagnosis.
    inflow_m3h : float, optional
        At the time of the act, where it is not the mean of the recording. [m³/h]
    seed : int
        Of the noise in what is simulated.

    Raises
    ------
    ConfigError
        If the folder has no diagnosis, or one that cannot be used.
    """
    path = diagnosis / LEFT_OPEN
    try:
        left = LeftOpen.model_validate_json(path.read_bytes())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}: give the folder of a diagnosis") from error
    except ValidationError as error:
        raise ConfigError(f"{path}: {first_fault(error)}") from error
    station = left.station
    if prices is not None:
        if prices.name != station.name:
            raise ConfigError(f"{path}: is of station '{station.name}', --station of '{prices.name}'")
        station = station.model_copy(update={"costs": prices.costs, "control": prices.control})
    if station.control.is_external:
        raise ConfigError(
            f"{path}: control.mode: 'external': nobody knows when pumps start, so that no act can be simulated"
        )
    conditions = left.conditions if inflow_m3h is None else left.conditions_under(inflow_m3h)
    with ThreadPoolExecutor(THREADS) as pool:
        found = proposals_of(station, [one.possible for one in left.sets], conditions, seed=seed, each=pool.map)
    costs = station.costs or Costs()
    return {
        "schema": EXPERIMENTS_SCHEMA,
        "station": station.name,
        "inflow_m3h": round(conditions.inflow_m3h, 3),
        "prices": {
            "energy_per_kwh": costs.energy_per_kwh,
            "crew_per_hour": costs.crew_per_hour,
            "are_defaults": station.costs is None,
        },
        "sets": [
            {"effects": list(one.possible.names), "probability": round(one.probability, 6)} for one in left.sets
        ],
        "experiments": [one.model_dump(mode="json") for one in proposed_acts(found)],
        "refused": [one.model_dump(mode="json") for one in refused_acts(found)],
    }


def steps_of(path: Path) -> tuple[Step, ...]:
    """Steps of the first experiment in a report of a diagnosis, or in what `wetwell gap experiment --json` says.

    Raises
    ------
    ConfigError
        If the file cannot be read, or has no experiment.
    """
    try:
        table = json.loads(path.read_bytes())
        acts = table["experiments"]
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ConfigError(f"{path}: has no 'experiments': give a report.json of wetwell gap diagnose") from error
    if not acts:
        raise ConfigError(f"{path}: proposes no experiment")
    try:
        first = ProposedAct.model_validate(acts[0])
    except ValidationError as error:
        raise ConfigError(f"{path}: experiments[1]: {first_fault(error)}") from error
    return tuple(step.step for step in first.steps)
