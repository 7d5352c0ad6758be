"""Cost of the control-room page: one JSON object on standard output.

    python benchmarks/dashboard.py [--stations 1000] [--seconds 20] [--followers 200] [--days 90] [--only-past]

Router and dashboard run as processes of their own on free ports of this machine. The server's share of a core is its
time on the processor over the time on the wall, while so many stations send a sample a second and one page follows
the overview. The browser (Debian's chromium, by playwright) opens the overview and one station; of first paints the
least and the median of several are told, each with an empty cache. Without chromium its figures are null. Then
so many followers look at one station: their delay is from the stamp of a sample to the frame that has it. Last, a
historian has so many days of a station (the same simulated day of scenario nominal, seed 1, one sample a second, with
a verdict for each run and a change of state each ten days), and the page of them all is opened: `drawn` is from the
navigation until its trends are drawn, `all_s` until energy and changes of state are there too.
"""

import argparse
import asyncio
import contextlib
import json
import os
import platform
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.verdict.station_model import StationModel
from wetwell.protocols.bus.keys import model_key, sample_key, verdict_key
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.services.historian.hours import Hours
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, StationSpan
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.lifecycle import ticks
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

CHROMIUM = Path("/usr/bin/chromium")
WARM_UP_S = 5.0
PAINTS = 7
STATION = "alpha"
DRAWN = "() => /[0-9]{2,} points/.test(document.querySelector('#trend-note')?.textContent) && performance.now()"
TRANSFERRED = "performance.getEntriesByType('resource').reduce((all, each) => all + each.transferSize, 0)"
ALL_DRAWN = """() => document.querySelector('.is-kpi tbody tr')
  && document.querySelectorAll('.is-episodes .changes button').length && performance.now()"""


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port: int = listener.getsockname()[1]
        return port


@contextlib.contextmanager
def wetwell(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(  # noqa: S603 - the command is ours
        [sys.executable, "-m", "wetwell.services", *arguments], stderr=subprocess.DEVNULL
    )
    try:
        yield process
    finally:
        process.terminate()
        process.wait(20)


def processor_s(pid: int) -> float:
    """Time that a process has had on the processor. [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Fleet:
    """Stations that each send a sample a second, spread over it."""

    def __init__(self, bus: ZenohBus, stations: int) -> None:
        station = find_station("alpha")
        names = [f"station-{number:04d}" for number in range(stations)]
        self._samples = [(name, bus.publisher(sample_key(name))) for name in names]
        for name in names:
            verdict = Verdict(
                time=now_ns(),
                station=name,
                pump=1,
                state="normal",
                probability={"normal": 1.0},
                evidence={},
                window=(now_ns(), now_ns()),
            )
            bus.publisher(verdict_key(name, 1)).put(verdict.encode())
        first = StationModel(station.model_copy(update={"name": names[0]}))
        model = first.message((None,) * datasheet_of(station).pumps, {}, now_ns())
        bus.publisher(model_key(names[0])).put(model.encode())

    async def run(self) -> None:
        """Send for ever, a tenth of the stations each tenth of a second."""
        seq = 0
        async for elapsed_s in ticks(0.1):
            pump = PumpReading(
                frequency_hz=50.0, flow_m3h=200.0 + elapsed_s % 7, head_m=26.0, power_kw=18.0, running=True
            )
            rest = PumpReading(frequency_hz=0.0, flow_m3h=0.0, head_m=0.0, power_kw=0.4, running=False)
            for name, publisher in self._samples[seq % 10 :: 10]:
                sample = Sample(
                    station=name,
                    seq=seq,
                    time=now_ns(),
                    level_m=1.0 + elapsed_s % 1.0,
                    inflow_m3h=150.0,
                    pumps=(pump, rest, rest),
                )
                publisher.put(sample.encode())
            seq += 1


async def follow(url: str, counts: dict[str, int]) -> None:
    """Count the bytes and frames of the overview."""
    async with httpx.AsyncClient(timeout=None) as client, client.stream("GET", f"{url}/events") as stream:  # noqa: S113
        async for data in stream.aiter_raw():
            counts["bytes"] += len(data)
            counts["frames"] += data.count(b"data: ")


async def frame_delays_s(url: str, followers: int, seconds: float) -> list[float]:
    """Delay of each frame at each of so many followers of a station, in order. [s]."""
    delays_s: list[float] = []

    async def look(client: httpx.AsyncClient) -> None:
        async with client.stream("GET", f"{url}/events", params={"station": "station-0000"}) as stream:
            async for line in stream.aiter_lines():
                rows = json.loads(line.removeprefix("data: ")).get("rows") if line.startswith("data: {") else None
                if rows:
                    delays_s.append(time.time() - rows[-1][0] / 1000)

    async with httpx.AsyncClient(timeout=None, limits=httpx.Limits(max_connections=None)) as client:  # noqa: S113
        looking = [asyncio.create_task(look(client)) for _ in range(followers)]
        await asyncio.sleep(WARM_UP_S)
        delays_s.clear()
        await asyncio.sleep(seconds)
        for task in looking:
            task.cancel()
        await asyncio.gather(*looking, return_exceptions=True)
    return sorted(delays_s)


def paints(url: str) -> dict[str, Any] | None:
    """First paints of a page and what it transfers."""
    if not CHROMIUM.exists():
        return None
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - may be missing

    first_ms, sizes = [], []
    with sync_playwright() as tools:
        flags = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
        browser = tools.chromium.launch(executable_path=str(CHROMIUM), args=flags)
        for _ in range(PAINTS):
            context = browser.new_context(viewport={"width": 1600, "height": 1000})
            page = context.new_page()
            page.goto(url)
            page.locator("#link", has_text="live").wait_for()
            first_ms.append(page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime"))
            sizes.append(
                page.evaluate(
                    "[...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')]"
                    ".filter(entry => !entry.name.includes('/history?'))"
                    ".reduce((sum, entry) => sum + entry.transferSize, 0)"
                )
            )
            context.close()
        browser.close()
    return {
        "first_paint_least_s": round(min(first_ms) / 1000, 3),
        "first_paint_median_s": round(statistics.median(first_ms) / 1000, 3),
        "transferred_kb": round(max(sizes) / 1000, 1),
    }


async def measured(stations: int, seconds: float, followers: int) -> dict[str, Any]:
    endpoint, port = f"tcp/127.0.0.1:{free_port()}", free_port()
    url = f"http://127.0.0.1:{port}"
    with (
        wetwell("router", "--zenoh", endpoint),
        wetwell("dashboard", "--zenoh", endpoint, "--page", f"127.0.0.1:{port}") as server,
        await connect_client(endpoint) as bus,
    ):
        sending = asyncio.create_task(Fleet(bus, stations).run())
        async with httpx.AsyncClient() as client:
            known = 0
            while known < stations:
                await asyncio.sleep(0.5)
                with contextlib.suppress(httpx.TransportError):
                    known = len((await client.get(f"{url}/api/stations")).json()["stations"])
        alone_share = await share_of_a_core(server.pid, seconds)
        counts = {"bytes": 0, "frames": 0}
        following = asyncio.create_task(follow(url, counts))
        await asyncio.sleep(WARM_UP_S)
        before = dict(counts)
        followed_share = await share_of_a_core(server.pid, seconds)
        stream = {name: (counts[name] - before[name]) / seconds for name in counts}
        following.cancel()
        pages = {
            name: await asyncio.to_thread(paints, url + path)
            for name, path in {"overview": "/", "station": "/station/station-0000"}.items()
        }
        delays_s = await frame_delays_s(url, followers, seconds)
        sending.cancel()
    return {
        "stations": stations,
        "share_of_a_core": round(followed_share, 4),
        "share_of_a_core_without_page": round(alone_share, 4),
        "stream_kb_per_s": round(stream["bytes"] / 1000, 1),
        "stream_frames_per_s": round(stream["frames"], 2),
        "pages": pages,
        "followers": {
            "number": followers,
            "frames": len(delays_s),
            "delay_median_s": round(statistics.median(delays_s), 3),
            "delay_p99_s": round(delays_s[int(0.99 * len(delays_s))], 3),
        },
    }


def keep_days(folder: Path, days: int) -> int:
    """Fill a historian's folder with days of one station; how many verdicts it got."""
    store = FolderStore(folder)
    recording = Simulation(find_station("alpha"), find_scenario("nominal"), 1).advance(86_400)
    day = Samples.of_recording(recording)
    start_ns = int(day.time_ns[0])
    hours = Hours.of_samples(day, start_ns, start_ns + DAY_NS)
    historian = Historian(store)
    verdicts = 0
    store.live.adopt([StationSpan(STATION, start_ns, start_ns + days * DAY_NS - 1)])
    for number in range(days):
        shift_ns = number * DAY_NS
        store.archive.write_samples(STATION, start_ns + shift_ns, replace(day, time_ns=day.time_ns + shift_ns))
        for second in range(0, 86_400, 450):
            historian.handle("verdicts", verdict_at(start_ns + shift_ns + second * 10**9, number))
            verdicts += 1
        historian.commit(start_ns)
        store.live.write_hours(STATION, replace(hours, hour_ns=hours.hour_ns + shift_ns))
    while historian.maintain(start_ns + days * DAY_NS):
        pass
    store.close()
    return verdicts


def verdict_at(time_ns: int, day: int) -> bytes:
    """A verdict as long as those of the detector are."""
    state: State = "system_fault" if day // 10 % 2 else "normal"
    verdict = Verdict(
        time=time_ns,
        station=STATION,
        pump=1 + time_ns // (450 * 10**9) % 3,
        state=state,
        probability={state: 1.0},
        evidence={"figures": [round(1e-3 * number, 3) for number in range(200)]},
        window=(time_ns - 300 * 10**9, time_ns),
    )
    return verdict.encode()


def page_of_days(days: int) -> dict[str, Any] | None:
    """Times of the page of so many days, each with an empty cache of the browser."""
    if not CHROMIUM.exists():
        return None
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - may be missing

    endpoint, port = f"tcp/127.0.0.1:{free_port()}", free_port()
    paint_ms, drawn_ms, all_ms, sizes = [], [], [], []
    with tempfile.TemporaryDirectory() as folder:
        verdicts = keep_days(Path(folder), days)
        with (
            wetwell("router", "--zenoh", endpoint),
            wetwell("historian", "--zenoh", endpoint, "--data", folder),
            wetwell("dashboard", "--zenoh", endpoint, "--page", f"127.0.0.1:{port}"),
            sync_playwright() as tools,
        ):
            url = f"http://127.0.0.1:{port}/station/{STATION}"
            wait_for_station(url)
            flags = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
            browser = tools.chromium.launch(executable_path=str(CHROMIUM), args=flags)
            for _ in range(PAINTS):
                context = browser.new_context(viewport={"width": 1600, "height": 1000})
                page = context.new_page()
                page.goto(f"{url}?span={days}d")
                drawn_ms.append(page.wait_for_function(DRAWN).json_value())
                all_ms.append(page.wait_for_function(ALL_DRAWN).json_value())
                paint_ms.append(page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime"))
                sizes.append(
                    page.evaluate(
                        "performance.getEntriesByType('resource').reduce((all, one) => all + one.transferSize, 0)"
                    )
                )
                context.close()
            browser.close()
    return {
        "days": days,
        "verdicts": verdicts,
        "first_paint_least_s": round(min(paint_ms) / 1000, 3),
        "drawn_least_s": round(min(drawn_ms) / 1000, 3),
        "drawn_median_s": round(statistics.median(drawn_ms) / 1000, 3),
        "all_least_s": round(min(all_ms) / 1000, 3),
        "all_median_s": round(statistics.median(all_ms) / 1000, 3),
        "transferred_with_history_kb": round(max(sizes) / 1000, 1),
    }


def wait_for_station(url: str) -> None:
    """Until the page knows the station from the historian."""
    until_s = time.monotonic() + 120.0
    while time.monotonic() < until_s:
        with contextlib.suppress(httpx.TransportError):
            if httpx.get(url, timeout=30.0).status_code == 200:
                return
        time.sleep(0.2)
    raise SystemExit(f"{url}: nobody knows the station")


async def share_of_a_core(pid: int, seconds: float) -> float:
    """Time on the processor over time on the wall."""
    before_s, start_s = processor_s(pid), time.monotonic()
    await asyncio.sleep(seconds)
    return (processor_s(pid) - before_s) / (time.monotonic() - start_s)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stations", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--followers", type=int, default=200)
    parser.add_argument("--days", type=int, default=90, choices=(7, 30, 90))
    parser.add_argument("--only-past", action="store_true")
    arguments = parser.parse_args()
    figures: dict[str, Any] = {}
    if not arguments.only_past:
        figures = asyncio.run(measured(arguments.stations, arguments.seconds, arguments.followers))
    figures["past"] = page_of_days(arguments.days)
    figures["machine"] = {
        "processors": os.cpu_count(),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
    }
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
