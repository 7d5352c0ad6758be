"""Whether the memory of page, alarms and historian has a bound when stations run far faster than life.

    python benchmarks/flood.py --stations 20 --speed 600 --seconds 180

A process sends the samples of all stations, one in a message or gathered; router and daemons are processes of their
own. `peak_mb` is the largest resident memory of each, `slope_mb_per_min` that of a straight line through its second
half. `told` are the figures in which a daemon says what it has passed over.
"""

import argparse
import asyncio
import json
import multiprocessing
import os
import platform
import tempfile
import time
from pathlib import Path

import numpy as np
from site_processes import Site, free_endpoint, started

from wetwell.protocols.bus.keys import SITE, sample_block_key, sample_key
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client, open_router
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

TOLD = ("samples", "taken", "committed", "waiting", "dropped", "lost", "doubled", "malformed", "passed_over")
DAEMONS = ("historian", "alarms", "dashboard")
HISTORY = 600
TICK_S = 0.01
SETTLE_S = 5.0
PLAYED_S = 600


def flood(endpoint: str, stations: int, speed: float, seconds: float, gather: int) -> None:
    """Publish so many samples a second of each station, `gather` in a message."""
    recording = Simulation(find_station("alpha"), find_scenario("nominal"), seed=1).advance(PLAYED_S, truth=False)
    samples = list(recording.samples("alpha"))
    first_ns = samples[0].time

    def sample(name: str, seq: int) -> Sample:
        change = {"station": name, "seq": seq, "time": first_ns + seq * NS_PER_S}
        return samples[seq % PLAYED_S].model_copy(update=change)

    def message(name: str, number: int) -> bytes:
        if gather == 1:
            return sample(name, number).encode()
        return SampleBlock.of([sample(name, number * gather + place) for place in range(gather)]).encode()

    async def run() -> None:
        key = sample_key if gather == 1 else sample_block_key
        names = [f"s{number:04d}" for number in range(stations)]
        with await connect_client(endpoint) as bus:
            publishers = [bus.publisher(key(name), history=HISTORY) for name in names]
            sent, start_s = 0, time.monotonic()
            while (elapsed_s := time.monotonic() - start_s) < seconds:
                due = int(elapsed_s * speed / gather)
                while sent < due:
                    for name, publisher in zip(names, publishers, strict=True):
                        publisher.put(message(name, sent), gather)
                    sent += 1
                await asyncio.sleep(TICK_S)
            await asyncio.sleep(SETTLE_S)

    asyncio.run(run())


async def observe(bus: ZenohBus, pids: dict[str, int], arguments: argparse.Namespace, endpoint: str) -> Site:
    site = Site(bus, pids)
    hearing = asyncio.create_task(site.hear_statuses())
    await site.wait_for(0, services=len(DAEMONS))
    looking = asyncio.create_task(site.look(1.0))
    words = (endpoint, arguments.stations, arguments.speed, arguments.seconds, arguments.gather)
    player = multiprocessing.get_context("spawn").Process(target=flood, args=words)
    player.start()
    await asyncio.to_thread(player.join)
    await asyncio.sleep(SETTLE_S)
    for task in (hearing, looking):
        task.cancel()
    await asyncio.gather(hearing, looking, return_exceptions=True)
    return site


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stations", type=int, default=20)
    parser.add_argument("--speed", type=float, default=600.0, help="samples a second of each station")
    parser.add_argument("--seconds", type=float, default=180.0)
    parser.add_argument("--gather", type=int, default=1, help="samples in a message")
    arguments = parser.parse_args()
    endpoint = free_endpoint()
    with tempfile.TemporaryDirectory(prefix="wetwell-flood-") as folder:
        settings = {
            "historian": {"folder": str(Path(folder) / "history")},
            "dashboard": {"port": 0},
            "health": {"period_s": 2.0},
        }
        commands = {"historian": ["historian"], "alarms": ["alarms"], "dashboard": ["dashboard"]}
        with open_router(endpoint) as bus, started(commands, endpoint, **settings) as running:
            pids = {name: process.pid for name, process in running.items()}
            site = asyncio.run(observe(bus, pids, arguments, endpoint))
    times_min = np.array([point["time_s"] for point in site.curve]) / 60.0
    late = times_min >= (times_min[0] + times_min[-1]) / 2.0
    result: dict[str, object] = {
        "stations": arguments.stations,
        "samples_per_s": arguments.stations * arguments.speed,
        "seconds": arguments.seconds,
        "gather": arguments.gather,
    }
    for name in DAEMONS:
        memory_mb = np.array([point[f"{name}_mb"] for point in site.curve])
        cpu_s = site.curve[-1][f"{name}_cpu_s"] - site.curve[0][f"{name}_cpu_s"]
        result[name] = {
            "peak_mb": round(float(memory_mb.max()), 1),
            "end_mb": round(float(memory_mb[-1]), 1),
            "slope_mb_per_min": round(float(np.polyfit(times_min[late], memory_mb[late], 1)[0]), 2),
            "cpu_share": round(cpu_s / (60.0 * float(times_min[-1] - times_min[0])), 3),
            "told": {
                figure: value
                for figure, value in site.figures.get((SITE, name), {}).items()
                if figure in TOLD and value
            },
        }
    result["machine"] = {"cores": os.cpu_count(), "python": platform.python_version(), "load": os.getloadavg()[0]}
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
