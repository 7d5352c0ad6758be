"""Daemons of a site as processes, for a browser to look at."""

import contextlib
import csv
import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest
from ports import free_port

DEADLINE_S = 180.0
SCENARIO = """
name = "quick-blockage"
clock_speed = 6000

[inflow]
kind = "empirical"

[[fault]]
kind = "blockage"
pump = 2
speed_loss = 0.3
start_s = 25_200
end_s = 27_000
after = "hold"
"""

CLOGGING = """
name = "quick-clogging"
clock_speed = 2400  # its page is watched from the start

[inflow]
kind = "empirical"

[[fault]]
kind = "pipe_clogging"
friction_rise = 0.5
static_rise_m = 0.3
start_s = 25_200
end_s = 27_000
after = "hold"
"""


@contextlib.contextmanager
def wetwell(*arguments, **environment):
    """A command as a process; killed at the end if it has not ended."""
    process = subprocess.Popen(
        [sys.executable, "-m", "wetwell.services", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"WETWELL_HEALTH__PERIOD_S": "1"} | environment,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def until(is_so, *processes):
    """Wait until something is so that these processes do: there is no virtual time here."""
    end = time.monotonic() + DEADLINE_S
    while time.monotonic() < end:
        for process in processes:
            assert process.poll() is None, f"{process.args} has ended"
        with contextlib.suppress(httpx.TransportError):
            if is_so():
                return
        time.sleep(0.2)
    pytest.fail(f"was not so within {DEADLINE_S:g} s")


@dataclass
class Site:
    """Where the processes of the site are."""

    endpoint: str
    port: int
    folder: Path
    processes: dict[str, subprocess.Popen[str]] = field(default_factory=dict)

    def kill(self, name):
        """End a part at once, as a power cut does."""
        self.processes[name].kill()
        self.processes[name].wait()

    @property
    def acts(self):
        """Acts that the alarms daemon has written into its audit."""
        lines = (self.folder / "alarms" / "alarm-audit.jsonl").read_text(encoding="utf-8").splitlines()
        return [json.loads(line) for line in lines]

    def stage_of(self, asset):
        """Stage of the gravest fault of the station, if it is of this asset."""
        stations = httpx.get(f"{self.url}/api/stations", timeout=10).json()["stations"].values()
        return next((one["cause"]["stage"] for one in stations if (one["cause"] or {}).get("asset") == asset), None)

    def plant_clock(self, **order):
        """How the clock of the plant stands after an order, or without one."""
        return httpx.post(f"{self.url}/api/stations/alpha/plant-clock", json=order, timeout=DEADLINE_S).json()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}"

    @contextlib.contextmanager
    def dashboard(self, port, **environment):
        with wetwell("dashboard", "--zenoh", self.endpoint, "--page", f"127.0.0.1:{port}", **environment) as process:
            until(lambda: httpx.get(f"http://127.0.0.1:{port}", timeout=2))
            yield process


@contextlib.contextmanager
def whole_site(folder, scenario_text, stale_s=10.0):
    """All daemons of a site, and a simulated station; its level is always too high."""
    scenario = folder / "quick.toml"
    scenario.write_text(scenario_text)
    place = Site(f"tcp/127.0.0.1:{free_port()}", free_port(), folder)
    common = ["--zenoh", place.endpoint]
    of_alarms = {"WETWELL_ALARMS__STATE_DIR": str(folder / "alarms"), "WETWELL_ALARMS__HIGH_LEVEL_M": "0.1"}
    commands = {
        "router": ["router", *common],
        "historian": ["historian", *common, "--data", str(folder / "history")],
        "alarms": ["alarms", *common],
        "detector": ["detector", *common],
        "simulator": ["simulator", "--scenario", str(scenario), *common],
    }
    with contextlib.ExitStack() as stack:
        for name, command in commands.items():
            if name == "simulator":
                page = place.dashboard(place.port, WETWELL_DASHBOARD__STALE_S=str(stale_s))
                place.processes["dashboard"] = stack.enter_context(page)
            place.processes[name] = stack.enter_context(wetwell(*command, **(of_alarms if name == "alarms" else {})))
        yield place


def rows_taken_along(page, panel, folder):
    """Rows of the CSV file that a panel, or the page itself, gives of what it draws."""
    with page.expect_download() as download:
        panel.get_by_role("button", name="download what is drawn").click()
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    with path.open() as file:
        return list(csv.DictReader(file))
