"""A whole site of real processes under load: latency, losses, CPU and memory. Prints one JSON object.

Router, detector, historian and alarms run as users start them; one more process plays the stations. The detector
begins with checkpoints of stations that have been learnt, so that every run is judged in full.
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import os
import platform
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from site_week import memory_of_a_week

from wetwell.detector.block import blocks
from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.protocols.keys import SITE, sample_key, status_key, verdict_key
from wetwell.protocols.messages import Status, Verdict
from wetwell.protocols.recording import Recording
from wetwell.protocols.stamps import NS_PER_S
from wetwell.protocols.zenoh_link import ZenohBus, connect_client
from wetwell.services.charts import Series, line_chart
from wetwell.services.daemon import PARENT_VARIABLE
from wetwell.services.presets import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

LEARNT_S = 28_800
"""So much of each recording is judged beforehand; the faults of scenario `demo` begin then."""
SHIFT_S = 97
"""Two stations that share a recording are so far apart in it."""
RECORDINGS = 16
SCENARIOS = ("nominal", "demo")
SUMP_AREA_M2 = 2.0
"""A small wet well: about 130 runs a pump and day."""
HISTORY = 600
SETTLE_S = 5.0
TICK_S = 0.01
PATIENCE_S = 300.0
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Played:
    """A station of the load: a stretch of a recording."""

    name: str
    recording: Recording
    begin_s: int


def part_of(recording: Recording, begin: int, end: int) -> Recording:
    columns = {name: values[begin:end] for name, values in recording.columns.items()}
    return replace(recording, time_ns=recording.time_ns[begin:end], columns=columns)


def prepare(folder: Path, stations: int, seconds: int) -> list[Played]:
    """Write station files and checkpoints; what each station plays."""
    model = find_station("alpha")
    small = model.model_copy(update={"sump": model.sump.model_copy(update={"area_m2": SUMP_AREA_M2})})
    text = Path(sys.modules[Simulation.__module__].__file__ or "").parent / "stations" / "alpha.toml"
    source = text.read_text().replace("area_m2 = 8.0", f"area_m2 = {SUMP_AREA_M2}")
    for name in ("stations", "state"):
        (folder / name).mkdir()
    played: list[Played] = []
    shares = -(-stations // RECORDINGS)
    for number in range(min(RECORDINGS, stations)):
        length_s = LEARNT_S + SHIFT_S * shares + seconds
        simulation = Simulation(small, find_scenario(SCENARIOS[number % 2]), seed=number + 1)
        recording = simulation.advance(length_s, truth=False)
        detector, begin_s = Detector("", nominal_of(small)), 0
        for share in range(shares):
            if (index := share * RECORDINGS + number) >= stations:
                break
            until_s = LEARNT_S + share * SHIFT_S
            for block in blocks(part_of(recording, begin_s, until_s), len(small.pump)):
                detector.take(block._replace(seq=block.seq + begin_s))
            begin_s, name = until_s, f"s{index:05d}"
            (folder / "stations" / f"{name}.toml").write_text(source.replace('"alpha"', f'"{name}"'))
            head, _, body = detector.snapshot().partition(b"\n")
            head = json.dumps(json.loads(head) | {"station": name}).encode()
            (folder / "state" / f"{name}.detector.json").write_bytes(head + b"\n" + body)
            played.append(Played(name, part_of(recording, begin_s, begin_s + seconds), begin_s))
    return sorted(played, key=lambda each: each.name)


def play(endpoint: str, played: list[Played], accelerate: float, out: Path) -> None:
    """Publish each station at so many samples a second, spread over it; keep when each was sent."""

    async def run() -> None:
        with await connect_client(endpoint) as bus:
            publishers = [bus.publisher(sample_key(each.name), history=HISTORY) for each in played]
            messages = [
                [sample.encode() for sample in each.recording.samples(each.name, each.begin_s)] for each in played
            ]
            sent_s = np.full((len(played[0].recording), len(played)), np.nan)
            await asyncio.sleep(SETTLE_S)
            start_s, count, late_s = time.monotonic(), 0, 0.0
            while count < sent_s.size:
                due = min(int((time.monotonic() - start_s) * accelerate * len(played)) + 1, sent_s.size)
                while count < due:
                    second, station = divmod(count, len(played))
                    sent_s[second, station] = now_s = time.monotonic()
                    publishers[station].put(messages[station][second])
                    late_s = max(late_s, now_s - start_s - count / (accelerate * len(played)))
                    count += 1
                await asyncio.sleep(TICK_S)
            np.savez(out, sent_s=sent_s, late_s=late_s)
            await asyncio.sleep(SETTLE_S)

    asyncio.run(run())


def cpu_and_memory(pid: int) -> tuple[float, float]:
    """CPU time and resident memory of a process. [s, MB]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS, pages * PAGE_BYTES / 1e6


@contextlib.contextmanager
def daemons(folder: Path, endpoint: str) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Start what a site has; at the end ask it to stop."""
    stations = str(folder / "stations")
    of_each = [word for path in sorted(Path(stations).iterdir()) for word in ("--station", str(path))]
    commands = {
        "router": ["router"],
        "historian": ["historian", "--data", str(folder / "history")],
        "alarms": ["alarms", *of_each],
        "detector": ["detector", "--station", stations],
    }
    environment = os.environ | {
        "WETWELL_DETECTOR": json.dumps({"state_dir": str(folder / "state")}),
        "WETWELL_ALARMS": json.dumps({"state_dir": str(folder / "alarms")}),
        PARENT_VARIABLE: "1",
        "WETWELL_LOG": json.dumps({"level": "ERROR"}),
    }
    started: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, words in commands.items():
            command = [sys.executable, "-m", "wetwell.services", *words, "--zenoh", endpoint]
            started[name] = subprocess.Popen(command, env=environment, stdin=subprocess.PIPE)  # noqa: S603 - our own commands
        yield started
    finally:
        for process in reversed(started.values()):
            process.terminate()
            process.wait()


class Site:
    """What is heard of a site, and what its processes use."""

    def __init__(self, bus: ZenohBus, pids: dict[str, int]) -> None:
        self.arrivals: list[tuple[float, Verdict]] = []
        self.figures: dict[tuple[str, str], dict[str, float]] = {}
        self.curve: list[dict[str, float]] = []
        self._pids = pids
        self._verdicts = bus.subscribe(verdict_key("*"), capacity=1_000_000)
        self._statuses = bus.subscribe(status_key("*", "*"), history=1, capacity=1_000_000)

    async def hear_verdicts(self) -> None:
        """Keep verdicts and when they came, for ever."""
        while True:
            payloads = await self._verdicts.receive()
            now_s = time.monotonic()
            self.arrivals += [(now_s, Verdict.decode(payload)) for payload in payloads]

    async def hear_statuses(self) -> None:
        """Keep the last health figures of each service, for ever."""
        while True:
            for payload in await self._statuses.receive():
                status = Status.decode(payload)
                self.figures[status.station, status.service] = status.figures

    async def wait_for(self, stations: int) -> None:
        """Until every daemon has shown itself."""
        async with asyncio.timeout(PATIENCE_S):
            while self._shown() < stations + 2:  # noqa: ASYNC110 - they show themselves on the bus
                await asyncio.sleep(0.2)

    def _shown(self) -> int:
        return sum(service == "detector" or station == SITE for station, service in self.figures)

    async def look(self, period_s: float) -> None:
        """Note what the processes use, for ever."""
        while True:
            self.look_once()
            await asyncio.sleep(period_s)

    def look_once(self) -> None:
        """Note what the processes use."""
        point = {"time_s": time.monotonic(), "load": os.getloadavg()[0]}
        for name, pid in self._pids.items():
            point[f"{name}_cpu_s"], point[f"{name}_mb"] = cpu_and_memory(pid)
        self.curve.append(point)

    def summed(self, service: str) -> dict[str, float]:
        """Health figures of a service over all stations."""
        total: dict[str, float] = {}
        for (_, each), figures in self.figures.items():
            if each == service:
                for name, value in figures.items():
                    total[name] = total.get(name, 0.0) + value
        return total


async def observe(endpoint: str, folder: Path, load: list[Played], accelerate: float, period_s: float) -> Site:
    """Run the load against the daemons."""
    with daemons(folder, endpoint) as started, await connect_client(endpoint) as bus:
        site = Site(bus, {name: process.pid for name, process in started.items()})
        hearing = [asyncio.create_task(site.hear_verdicts()), asyncio.create_task(site.hear_statuses())]
        begun_s = time.monotonic()
        await site.wait_for(len(load))
        print(f"all daemons up after {time.monotonic() - begun_s:.1f} s", file=sys.stderr)
        context = multiprocessing.get_context("spawn")
        player = context.Process(target=play, args=(endpoint, load, accelerate, folder / "sent.npz"), daemon=True)
        player.start()
        await asyncio.sleep(SETTLE_S)
        hearing.append(asyncio.create_task(site.look(period_s)))
        while player.is_alive():
            for name, process in started.items():
                if process.poll() is not None:
                    raise SystemExit(f"{name} has ended with code {process.returncode}")
            await asyncio.sleep(0.5)
        hearing.pop().cancel()
        site.look_once()
        await asyncio.sleep(10.0 + SETTLE_S)  # the last health figures
        for task in hearing:
            task.cancel()
        await asyncio.gather(*hearing, return_exceptions=True)
    return site


def latencies_ms(site: Site, load: list[Played], sent_s: np.ndarray) -> np.ndarray:
    """From the put of the sample that a verdict stands on to the arrival of the verdict."""
    place = {each.name: (column, int(each.recording.time_ns[0])) for column, each in enumerate(load)}
    found = []
    for arrived_s, verdict in site.arrivals:
        column, first_ns = place[verdict.station]
        row = (verdict.time - first_ns) // NS_PER_S
        if 0 <= row < len(sent_s):  # else one that was told again after the start
            found.append(1e3 * (arrived_s - sent_s[row, column]))
    return np.array(found)


def slope(times_s: np.ndarray, values: np.ndarray) -> float:
    """Of a straight line, per hour."""
    return float(np.polyfit(times_s / 3600.0, values, 1)[0])


def processes(curve: list[dict[str, float]], stations: int) -> dict[str, dict[str, float]]:
    """CPU and memory of each process; the slope over the second half, when all caches are full."""
    times_s = np.array([point["time_s"] for point in curve])
    late = times_s >= (times_s[0] + times_s[-1]) / 2.0
    wall_s = times_s[-1] - times_s[0]
    result: dict[str, dict[str, float]] = {}
    for name in [key.removesuffix("_mb") for key in curve[0] if key.endswith("_mb")]:
        memory_mb = np.array([point[f"{name}_mb"] for point in curve])
        share = (curve[-1][f"{name}_cpu_s"] - curve[0][f"{name}_cpu_s"]) / wall_s
        result[name] = {
            "cpu_share": round(share, 4),
            "cores_per_1000_stations": round(share * 1000.0 / stations, 3),
            "memory_start_mb": round(memory_mb[0], 1),
            "memory_end_mb": round(memory_mb[-1], 1),
            "memory_slope_mb_per_h": round(slope(times_s[late], memory_mb[late]), 2) if late.sum() > 2 else 0.0,
        }
    return result


def kept(folder: Path) -> int:
    """Samples in the database of the historian, after its end."""
    with contextlib.closing(sqlite3.connect(next((folder / "history").glob("*.sqlite*")))) as database:
        return int(database.execute("SELECT count(*) FROM sample").fetchone()[0])


def plots(curve: list[dict[str, float]], folder: Path) -> None:
    """Write memory and CPU over time."""
    minutes = [(point["time_s"] - curve[0]["time_s"]) / 60.0 for point in curve]
    names = [key.removesuffix("_mb") for key in curve[0] if key.endswith("_mb")]
    memory = [Series(name, minutes, [point[f"{name}_mb"] for point in curve]) for name in names]
    spent = []
    for name in names:
        used_s = np.diff([point[f"{name}_cpu_s"] for point in curve])
        spent.append(Series(name, minutes[1:], 100.0 * used_s / np.diff([point["time_s"] for point in curve])))
    folder.mkdir(parents=True, exist_ok=True)
    time_axis = "time [min]"
    (folder / "soak.svg").write_text(
        line_chart("Memory of the daemons", memory, x_label=time_axis, y_label="resident [MB]")
    )
    (folder / "soak-cpu.svg").write_text(
        line_chart("CPU of the daemons", spent, x_label=time_axis, y_label="share of a core [%]")
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stations", type=int, default=100)
    parser.add_argument("--seconds", type=int, default=60, help="of each station")
    parser.add_argument("--accelerate", type=float, default=1.0, help="samples a second of each station")
    parser.add_argument("--plots", type=Path, help="folder for soak.svg and soak-cpu.svg")
    parser.add_argument("--week", type=int, metavar="DAYS", help="so many days in one process instead")
    arguments = parser.parse_args()
    if arguments.week is not None:
        with tempfile.TemporaryDirectory(prefix="wetwell-week-") as week_folder:
            print(json.dumps(memory_of_a_week(Path(week_folder), arguments.stations, arguments.week), indent=2))
        return
    stations, period_s = arguments.stations, max(arguments.seconds / arguments.accelerate / 180.0, 1.0)
    with socket.create_server(("127.0.0.1", 0)) as free:
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    load_before = os.getloadavg()[0]
    folder = Path(tempfile.mkdtemp(prefix="wetwell-site-"))
    try:
        load = prepare(folder, stations, arguments.seconds)
        site = asyncio.run(observe(endpoint, folder, load, arguments.accelerate, period_s))
        with np.load(folder / "sent.npz") as sent:
            sent_s, late_s = sent["sent_s"], float(sent["late_s"])
        in_database = kept(folder)
    finally:
        shutil.rmtree(folder)
    latency_ms, judged = latencies_ms(site, load, sent_s), site.summed("detector")
    judged["samples"] -= sum(each.begin_s for each in load)
    if arguments.plots is not None:
        plots(site.curve, arguments.plots)
    result = {
        "stations": stations,
        "seconds": arguments.seconds,
        "samples_per_s": stations * arguments.accelerate,
        "sent": sent_s.size,
        "bytes_a_sample": len(next(load[0].recording.samples(load[0].name)).encode()),
        "sent_late_at_most_s": round(late_s, 3),
        "verdicts": len(latency_ms),
        "sample_to_verdict_ms": {
            f"p{share}": round(float(np.percentile(latency_ms, share)), 1) for share in (50, 90, 99, 100)
        }
        if len(latency_ms)
        else {},
        "detector": {name: value for name, value in judged.items() if name != "sample_age_s"},
        "historian": site.figures.get((SITE, "historian"), {}) | {"in_database": in_database},
        "alarms": site.figures.get((SITE, "alarms"), {}),
        "processes": processes(site.curve, stations),
        "load": {"before": load_before, "mean": round(float(np.mean([p["load"] for p in site.curve])), 1)},
        "machine": {"cores": os.cpu_count(), "python": platform.python_version()},
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
