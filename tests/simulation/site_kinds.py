"""Sites to simulate, and their lives."""

import random
from collections.abc import Callable
from pathlib import Path

from accidents import Plan, plan_of
from simulated_site import Site
from virtual_loop import run_virtual

from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.scenario import Scenario

GRAIN_S = 0.25
"""Of the clock of a light site."""
MOST_COMINGS = 3
"""So often each fault of the scenario comes at most."""
LEARNT, LAST = 0.2, 0.9
"""Share of a life after which faults come, and until which."""
SHORTEST_S, LONGEST_S = 3_600.0, 21_600.0
"""Of a fault."""


def alpha_site(seed: int, stations: int, days: float, period_s: int, folder: Path, plan: Plan | None = None) -> Site:
    """Site of stations like the built-in one, with the paper's faults, after its life."""
    return _lived(seed, find_station("alpha"), stations, days, period_s, 0.0, folder, plan)


def light_site(seed: int, stations: int, days: float, period_s: int, folder: Path, plan: Plan | None = None) -> Site:
    """The same with one pump and a wide wet well, whose long runs can be judged by a sample each five minutes."""
    alpha = find_station("alpha")
    levels = {name: getattr(alpha.control, name)[:1] for name in ("start_levels_m", "stop_levels_m")}
    parts = {
        "pump": alpha.pump[:1],
        "sump": alpha.sump.model_copy(update={"area_m2": 80.0}),
        "control": alpha.control.model_copy(update=levels),
    }
    return _lived(seed, alpha.model_copy(update=parts), stations, days, period_s, GRAIN_S, folder, plan)


KINDS: dict[str, Callable[..., Site]] = {"alpha": alpha_site, "light": light_site}


def scenario_of(seed: int, seconds: float) -> Scenario:
    """The paper's faults, each as often and when the seed says, and over after a while."""
    dice = random.Random(f"faults {seed}")
    paper = find_scenario("paper")
    faults = []
    for fault in paper.fault:
        for _ in range(dice.randrange(MOST_COMINGS + 1)):
            start_s = dice.uniform(LEARNT, LAST) * seconds
            end_s = start_s + dice.uniform(SHORTEST_S, LONGEST_S)
            faults.append(fault.model_copy(update={"start_s": start_s, "end_s": end_s}))
    return paper.model_copy(update={"fault": tuple(faults)})


def _lived(
    seed: int,
    station: Station,
    stations: int,
    days: float,
    period_s: int,
    grain_s: float,
    folder: Path,
    plan: Plan | None,
) -> Site:
    """A site after its life; without a plan with that of its seed."""
    seconds = round(days * 86_400.0)
    site = Site(
        seed=seed,
        stations=[station.model_copy(update={"name": f"station-{number}"}) for number in range(stations)],
        scenario=scenario_of(seed, seconds),
        seconds=seconds,
        period_s=period_s,
        folder=folder,
        plan=plan_of(seed, seconds) if plan is None else plan,
    )
    run_virtual(site.live(), grain_s)
    return site
