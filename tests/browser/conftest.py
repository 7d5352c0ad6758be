"""A site in processes of its own, and a browser that looks at it."""

import contextlib
import json
import os
import socket
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect, sync_playwright

CHROMIUM = Path("/usr/bin/chromium")
SCREENSHOTS = Path(__file__).parents[2] / "build" / "screenshots"
DEADLINE_S = 120.0
expect.set_options(timeout=60_000)
SEE_CHARTS = """
let original = null;
window.charts = [];
Object.defineProperty(window, "uPlot", {
  get: () => original,
  set(made) {
    const construct = (kind, given) => window.charts[window.charts.push(new kind(...given)) - 1];
    original = new Proxy(made, { construct });
  },
});
"""
"""Puts all charts of a page into `charts`, in the order in which they were made."""
SCENARIO = """
name = "quick-blockage"
clock_speed = 2400

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

CLOGGING = (
    SCENARIO.partition("[[fault]]")[0]
    + """
[[fault]]
kind = "pipe_clogging"
friction_rise = 0.5
static_rise_m = 0.3
start_s = 25_200
end_s = 27_000
after = "hold"
"""
)


def pytest_collection_modifyitems(items):
    """Skip the tests of this folder where there is no browser; `items` are those of all folders."""
    if not CHROMIUM.exists():
        for item in items:
            if item.path.is_relative_to(Path(__file__).parent):
                item.add_marker(pytest.mark.skip(reason=f"{CHROMIUM} is not installed (Debian package chromium)"))


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


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


def wait_for(url):
    end = time.monotonic() + DEADLINE_S
    while time.monotonic() < end:
        with contextlib.suppress(httpx.TransportError):
            httpx.get(url, timeout=2)
            return
        time.sleep(0.05)  # a real process: there is no virtual time here
    pytest.fail(f"{url} did not answer within {DEADLINE_S:g} s")


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

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}"

    @contextlib.contextmanager
    def dashboard(self, port, **environment):
        with wetwell("dashboard", "--zenoh", self.endpoint, "--page", f"127.0.0.1:{port}", **environment) as process:
            wait_for(f"http://127.0.0.1:{port}")
            yield process


@contextlib.contextmanager
def whole_site(folder, scenario_text):
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
                place.processes["dashboard"] = stack.enter_context(place.dashboard(place.port))
            place.processes[name] = stack.enter_context(wetwell(*command, **(of_alarms if name == "alarms" else {})))
        yield place


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A site whose pump 2 is blocked after seven hours of its time."""
    with whole_site(tmp_path_factory.mktemp("site"), SCENARIO) as place:
        yield place


@pytest.fixture
def clogged_site(tmp_path):
    """A site of its own for one test, which may kill its parts: its main clogs after seven hours of its time."""
    with whole_site(tmp_path, CLOGGING) as place:
        yield place


@pytest.fixture(scope="module")
def browser():
    flags = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
    with sync_playwright() as tools:
        chromium = tools.chromium.launch(executable_path=str(CHROMIUM), args=flags)
        yield chromium
        chromium.close()


@pytest.fixture
def open_page(browser):
    """Opens addresses in a browser that may reach this machine only; at the end no page may have complained."""
    complaints, foreign, contexts = [], [], []

    def guard(route):
        if route.request.url.split("/")[2].split(":")[0] == "127.0.0.1":
            route.continue_()
        else:
            foreign.append(route.request.url)
            route.abort()

    def open_(url, *, may_lose_its_server=False, **options):
        context = browser.new_context(**{"viewport": {"width": 1600, "height": 1000}} | options)
        contexts.append(context)
        context.route("**/*", guard)
        context.add_init_script(SEE_CHARTS)
        page = context.new_page()
        if not may_lose_its_server:
            page.on(
                "console", lambda told: complaints.append(told.text) if told.type in {"error", "warning"} else None
            )
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(url)
        return page

    yield open_
    for context in contexts:
        context.close()
    assert complaints == []
    assert foreign == []


@pytest.fixture(scope="session")
def unused_port():
    return free_port


@pytest.fixture(scope="session")
def screenshots():
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    return SCREENSHOTS
