"""A fleet beside one detector process on the same load, and a worker that is killed. Prints one JSON object.

python benchmarks/fleet.py --stations 200 --seconds 60
python benchmarks/fleet.py --stations 200 --seconds 6000 --accelerate 1000 --gather 60 --health-s 1    # no pause

Router, detector and fleet run as users start them; one more process plays the stations. Every verdict is compared,
byte for byte, with what a detector says that takes the same samples from its checkpoint on without a bus.
"""

import argparse
import asyncio
import json
import multiprocessing
import os
import platform
import shutil
import signal
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from site_load import SETTLE_S, Played, play, prepare
from site_processes import PATIENCE_S, Site, cpu_and_memory, free_endpoint, started

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import blocks
from wetwell.protocols.bus.zenoh.link import connect_client
from wetwell.protocols.station.station_file import load_station
from wetwell.services.reports.charts.bar_chart import bar_chart

KILLED_HEALTH_S = 0.5
"""How often a judge says how many samples it has had while a worker is killed; the time is found to this."""
SHARDS = 8

Told = dict[tuple[str, int, int], bytes]
"""Verdicts by station, time and pump."""


def wanted(folder: Path, load: list[Played]) -> Told:
    """What one detector says that goes on from the checkpoint of each station."""
    told: Told = {}
    for each in load:
        station = load_station(folder / "stations" / f"{each.name}.toml")
        detector = Detector(station.name, datasheet_of(station))
        detector.restore((folder / "state" / f"{each.name}.detector.json").read_bytes())
        for block in blocks(each.recording, len(station.pump)):
            for verdict in detector.update_block(block._replace(seq=block.seq + each.begin_s)):
                told[verdict.station, verdict.time, verdict.pump] = verdict.encode()
    return told


def workers_of(pid: int) -> list[int]:
    """Processes that a process has started to work for it; itself if there are none."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == pid and b"spawn_main" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except (OSError, ValueError, IndexError):
            continue
    return found or [pid]


async def run(
    folder: Path, load: list[Played], given: argparse.Namespace, words: list[str], kill_s: float | None
) -> Any:
    """Figures of one way to judge; with `kill_s` a worker is killed so long after the first sample."""
    health_s = given.health_s if kill_s is None else KILLED_HEALTH_S
    samples = len(load) * given.seconds
    endpoint = free_endpoint()
    state = folder / "state-of-run"
    shutil.rmtree(state, ignore_errors=True)
    shutil.copytree(folder / "state", state)
    commands = {"router": ["router"], "judges": words}
    tables = {"detector": {"state_dir": str(state)}, "health": {"period_s": health_s}}
    with started(commands, endpoint, **tables) as running, await connect_client(endpoint) as bus:
        site = Site(bus, {})
        hearing = [asyncio.create_task(site.hear_verdicts()), asyncio.create_task(site.hear_statuses())]
        begun_s = time.monotonic()
        await site.wait_for(len(load))
        figures: dict[str, Any] = {"command": " ".join(["wetwell", *words]).replace(str(folder), "...")}
        figures["up_after_s"] = round(time.monotonic() - begun_s, 1)
        judges = running["judges"].pid
        before = {pid: cpu_and_memory(pid) for pid in {judges, *workers_of(judges)}}
        sent_file = folder / "sent.npz"
        player = multiprocessing.get_context("spawn").Process(
            target=play, args=(endpoint, load, given.accelerate, sent_file, given.gather), daemon=True
        )
        sent_file.unlink(missing_ok=True)
        player.start()
        if kill_s is not None:
            await asyncio.sleep(SETTLE_S + kill_s)
            os.kill(workers_of(judges)[0], signal.SIGKILL)
        killed_s = time.monotonic()
        async with asyncio.timeout(PATIENCE_S):
            while not sent_file.exists() or not is_through(site, load):
                if kill_s is not None and is_one_behind(site, load, given.accelerate):
                    figures["all_judged_again_after_s"] = round(time.monotonic() - killed_s, 1)
                await asyncio.sleep(0.1)
        through_s = time.monotonic()
        after = {pid: cpu_and_memory(pid) for pid in {judges, *workers_of(judges)}}
        await asyncio.to_thread(player.join)
        await asyncio.sleep(2.0)
        for task in hearing:
            task.cancel()
        await asyncio.gather(*hearing, return_exceptions=True)
    with np.load(sent_file) as sent:
        sent_s = sent["sent_s"]
    wall_s = through_s - float(sent_s.min())
    figures |= {
        "sent_per_s": round(samples / float(np.ptp(sent_s)), 1),
        "judged_per_s": round(samples / wall_s, 1),
        "memory_mb": round(sum(memory for _, memory in after.values()), 1),
    }
    if kill_s is None:
        spent_s = sum(cpu - before[pid][0] for pid, (cpu, _) in after.items())
        figures["cpu_us_a_sample"] = round(1e6 * spent_s / samples, 1)
    return figures | compared(site, wanted(folder, load))


def is_through(site: Site, load: list[Played]) -> bool:
    """Whether every sample has been judged."""
    judged = site.judged
    return all(judged.get(each.name, 0.0) >= each.begin_s + len(each.recording) for each in load)


def is_one_behind(site: Site, load: list[Played], accelerate: float) -> bool:
    """Whether a station is further behind the foremost one than the health figures are old."""
    judged = site.judged
    had = [judged.get(each.name, 0.0) - each.begin_s for each in load]
    return max(had) - min(had) > 3.0 * KILLED_HEALTH_S * accelerate


def compared(site: Site, right: Told) -> dict[str, int]:
    """How the verdicts that were heard differ from those of one detector."""
    heard: Told = {}
    counts = {"verdicts": len(right), "twice": 0, "different": 0}
    for _, verdict in site.arrivals:
        key, payload = (verdict.station, verdict.time, verdict.pump), verdict.encode()
        if key not in right:
            continue  # one from before, which a restored judge tells again
        counts["twice"] += key in heard
        counts["different"] += payload != right[key]
        heard[key] = payload
    return counts | {"missing": len(right.keys() - heard.keys())}


def chart(runs: dict[str, Any]) -> str:
    """Samples a second that each way has judged."""
    ways = {name: figures for name, figures in runs.items() if "cpu_us_a_sample" in figures}
    judged = [figures["judged_per_s"] / 1000.0 for figures in ways.values()]
    names = [name.replace("_", " ") for name in ways]
    return bar_chart("Judged samples a second", names, {"thousands": judged}, y_label="thousands a second")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stations", type=int, default=200)
    parser.add_argument("--seconds", type=int, default=60, help="of each station")
    parser.add_argument("--accelerate", type=float, default=1.0, help="samples a second of each station")
    parser.add_argument("--gather", type=int, default=1, help="samples in a message")
    parser.add_argument(
        "--health-s", type=float, default=5.0, help="a judge says how far it is; the rate is found to this"
    )
    parser.add_argument("--plots", type=Path, help="folder for fleet.svg")
    given = parser.parse_args()
    load_before = os.getloadavg()[0]
    folder = Path(tempfile.mkdtemp(prefix="wetwell-fleet-"))
    try:
        load = prepare(folder, given.stations, given.seconds)
        stations = str(folder / "stations")
        fleet = ["fleet", "--stations", stations, "--shards", str(SHARDS), "--workers"]
        ways = {
            "one_process": (["detector", "--station", stations], None),
            "fleet_of_1_worker": ([*fleet, "1"], None),
            "fleet_of_2_workers": ([*fleet, "2"], None),
            "a_worker_killed": ([*fleet, "2"], given.seconds / given.accelerate / 3.0),
        }
        runs = {name: asyncio.run(run(folder, load, given, words, kill_s)) for name, (words, kill_s) in ways.items()}
    finally:
        shutil.rmtree(folder)
    if given.plots is not None:
        (given.plots / "fleet.svg").write_text(chart(runs))
    result = {
        "stations": given.stations,
        "seconds": given.seconds,
        "accelerate": given.accelerate,
        "gather": given.gather,
        "shards": SHARDS,
        **runs,
        "load": {"before": load_before, "after": os.getloadavg()[0]},
        "machine": {"cores": os.cpu_count(), "python": platform.python_version()},
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
