"""A station simulated in Python."""

import os

from wetwell.protocols.errors import ConfigError
from wetwell.services.api.frame import Frame
from wetwell.services.api.sources import StationSource, station_of
from wetwell.services.stations import find_scenario
from wetwell.simulator.scenario import DEFAULT_START_NS, Scenario
from wetwell.simulator.simulation import Simulation


def simulate(
    station: StationSource = "alpha",
    scenario: str | os.PathLike[str] | Scenario = "nominal",
    *,
    days: float | None = None,
    seed: int = 1,
) -> Frame:
    """Simulate a station, one row a second, with truth columns.

    Parameters
    ----------
    station : Station, path or name
    scenario : Scenario, path or name
        Inflow and faults: `nominal`, `blockage`, `clogging`, `paper`, `demo`, or a scenario file.
    days : float, optional
        Length; by default the scenario's. [d]
    seed : int
        Same seed, same numbers. >= 0.

    Raises
    ------
    ConfigError
        If station or scenario break a rule.

    Examples
    --------
    >>> simulate("alpha", days=1 / 24, seed=7)
    Frame of station alpha: 3600 rows, 2025-01-01T00:00:00Z to 2025-01-01T00:59:59Z, 3 pumps
    """
    plan = scenario if isinstance(scenario, Scenario) else find_scenario(os.fspath(scenario))
    if days is not None and not 0.0 < days < float("inf"):
        raise ConfigError(f"days: got {days:g}, must be positive")
    try:
        simulation = Simulation(station_of(station), plan, seed, DEFAULT_START_NS)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    length_s = plan.duration_s if days is None else days * 86_400.0
    return Frame(simulation.advance(max(round(length_s), 1)))
