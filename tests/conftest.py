"""What the tests share: the paper's station, a deadline-free hypothesis, real recordings, a PostgreSQL server."""

import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from wetwell.protocols.station.station_file import Sensors, Station
from wetwell.services.cli import main
from wetwell.services.stations import find_station

# The first call of a kernel compiles it: a time limit for one example says nothing.
settings.register_profile("wetwell", deadline=None)
settings.load_profile("wetwell")


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


class PostgresServer:
    """A server of Debian's package, on a free port of this machine, in a folder of its own."""

    def __init__(self, programs: Path, folder: Path) -> None:
        self._programs, self._folder = programs, folder
        self._user = ["runuser", "-u", "postgres", "--"] if os.getuid() == 0 else []
        with socket.socket() as listener:
            listener.bind(("127.0.0.1", 0))
            self.port = listener.getsockname()[1]
        self.url = f"postgresql://wetwell@127.0.0.1:{self.port}/postgres"
        self._run("initdb", "-D", folder / "data", "-U", "wetwell", "--auth=trust", "--no-sync")

    def start(self) -> None:
        options = f"-p {self.port} -c listen_addresses=127.0.0.1 -c fsync=off -k {self._folder}"
        self._run("pg_ctl", "-D", self._folder / "data", "-w", "-l", self._folder / "log", "-o", options, "start")

    def stop(self) -> None:
        """Stop at once, as a crash would."""
        self._run("pg_ctl", "-D", self._folder / "data", "-m", "immediate", "stop")

    def _run(self, program: str, *arguments: object) -> None:
        command = [*self._user, str(self._programs / program), *map(str, arguments)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=self._folder, timeout=60)


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    """A running PostgreSQL server."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    if not found:
        pytest.skip("PostgreSQL is not installed where Debian's package puts it")
    folder = Path(tempfile.mkdtemp(prefix="wetwell-postgres-"))
    if os.getuid() == 0:
        shutil.chown(folder, "postgres")
    server = PostgresServer(found[-1].parent, folder)
    server.start()
    yield server
    server.stop()
    shutil.rmtree(folder)
