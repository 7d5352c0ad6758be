"""What the tests share: the paper's station, a deadline-free hypothesis, real recordings, a PostgreSQL server."""

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from postgres_server import PostgresServer, is_installed, running_server

from wetwell.protocols.station.station_file import Sensors, Station
from wetwell.services.cli import main
from wetwell.services.stations import find_station

# The first call of a kernel compiles it: a time limit for one example says nothing.
settings.register_profile("wetwell", deadline=None)
settings.load_profile("wetwell")

LONGEST = (
    *("test_site.py", "test_kill.py", "test_run_commands.py", "test_gap_rates.py", "test_gap.py", "test_trial.py"),
    *("test_processes.py", "test_blocks.py", "test_restart.py", "test_fleet.py", "test_watching.py", "test_start.py"),
    *("test_experiments.py", "test_simulated_site.py", "test_prometheus.py", "test_historian.py", "test_failover.py"),
)
"""Files that take longest."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files, so that at the end no worker waits for another."""
    items.sort(key=lambda item: item.path.name not in LONGEST)


@pytest.fixture(scope="session")
def alpha() -> Station:
    """The paper's station, with its noise."""
    return find_station("alpha")


@pytest.fixture(scope="session")
def quiet_alpha(alpha) -> Station:
    """The paper's station with perfect sensors."""
    quiet = Sensors(flow_noise=0, head_noise=0, power_noise=0, inflow_noise=0, level_noise_m=0)
    return alpha.model_copy(update={"sensors": quiet})


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings, outside of this repository."""
    name = os.environ.get("WETWELL_TEST_DATA")
    if not name:
        pytest.skip("WETWELL_TEST_DATA is not set; it names the folder that has skab/")
    folder = Path(name)
    if not (folder / "skab").is_dir():
        pytest.skip(f"WETWELL_TEST_DATA = {name} has no folder skab/")
    return folder


@pytest.fixture
def run_wetwell(monkeypatch) -> Callable[..., int]:
    """Function that runs a command `wetwell` in this process, and gives its exit code."""

    def run(*arguments: object) -> int:
        monkeypatch.setattr(sys, "argv", ["wetwell", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0)

    return run


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    """A running PostgreSQL server."""
    if not is_installed():
        pytest.skip("PostgreSQL is not installed where Debian's package puts it")
    with running_server() as server:
        yield server
