"""A site in processes of its own, with a stand-in for historian and alarms, and a browser that looks at it."""

import asyncio
import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import sync_playwright

from wetwell.protocols.alarm_messages import Alarm, AlarmAct, AlarmAnswer
from wetwell.protocols.history_messages import History, HistoryQuery
from wetwell.protocols.keys import alarm_act_key, alarm_key, history_key
from wetwell.protocols.stamps import NS_PER_S
from wetwell.protocols.zenoh_link import connect_client

CHROMIUM = Path("/usr/bin/chromium")
SCREENSHOTS = Path(__file__).parents[2] / "build" / "screenshots"
DEADLINE_S = 30.0
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


def pytest_collection_modifyitems(items):
    """Skip where there is no browser."""
    if not CHROMIUM.exists():
        for item in items:
            item.add_marker(pytest.mark.skip(reason=f"{CHROMIUM} is not installed (Debian package chromium)"))


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


@contextlib.contextmanager
def wetwell(*arguments):
    """A command as a process; killed at the end if it has not ended."""
    process = subprocess.Popen(
        [sys.executable, "-m", "wetwell.services", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"WETWELL_HEALTH__PERIOD_S": "1"},
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
    acts: list[AlarmAct] = field(default_factory=list)

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}"

    @contextlib.contextmanager
    def dashboard(self, port):
        with wetwell("dashboard", "--zenoh", self.endpoint, "--page", f"127.0.0.1:{port}") as process:
            wait_for(f"http://127.0.0.1:{port}")
            yield process


ALARM = Alarm(
    id="station.high_level",
    time=0,
    station="gamma",
    priority="urgent",
    state="unacknowledged",
    is_active=True,
    text="gamma: high level",
    advice="look at the inflow",
    raised=0,
)


async def stand_in(site, is_up, stop):
    """What historian and alarm service would say of the station gamma."""
    with await connect_client(site.endpoint) as bus:
        alarms = bus.publisher(alarm_key("gamma", ALARM.id))
        acts, questions = bus.answer(alarm_act_key("gamma")), bus.answer(history_key("*"))
        alarms.put(ALARM.encode())
        is_up.set()

        async def act():
            while True:
                for request in await acts.receive():
                    asked = AlarmAct.decode(request.payload)
                    site.acts.append(asked)
                    after = ALARM.model_copy(update={"state": "acknowledged", "by": asked.by})
                    alarms.put(after.encode())
                    request.reply(AlarmAnswer(id=asked.id, is_done=True, alarm=after).encode())

        async def remember():
            while True:
                for request in await questions.receive():
                    request.reply(history_of(HistoryQuery.decode(request.payload)).encode())

        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(act()), group.create_task(remember())]
            await asyncio.to_thread(stop.wait)
            for task in tasks:
                task.cancel()


def history_of(query):
    hours = range(max(query.start // (3600 * NS_PER_S) + 1, 0), query.end // (3600 * NS_PER_S) + 1)
    times = tuple(hour * 3600 * NS_PER_S for hour in hours)[-48:]
    values = tuple(float(place % 7) for place in range(len(times)))
    names = ("level_m", "energy_kwh", "volume_m3", "run_h", "starts", "pump1_energy_kwh", "pump1_starts")
    return History(station="x", kind=query.kind, time=times, columns=dict.fromkeys(names, values))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Router, detector, a simulated station with a blockage of pump 2, and the stand-in; without the dashboard."""
    scenario = tmp_path_factory.mktemp("site") / "quick.toml"
    scenario.write_text(SCENARIO)
    place = Site(f"tcp/127.0.0.1:{free_port()}", free_port())
    is_up, stop = threading.Event(), threading.Event()
    thread = threading.Thread(target=lambda: asyncio.run(stand_in(place, is_up, stop)))
    common = ["--zenoh", place.endpoint]
    with wetwell("router", *common), wetwell("detector", *common), place.dashboard(place.port):
        thread.start()
        try:
            assert is_up.wait(DEADLINE_S)
            with wetwell("simulator", "--scenario", str(scenario), *common):
                yield place
        finally:
            stop.set()
            thread.join()


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
