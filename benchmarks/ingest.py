"""How many station-samples a second a detector, or a historian, takes in messages of many. Prints one JSON object.

python benchmarks/ingest.py --daemon detector
python benchmarks/ingest.py --daemon historian
python benchmarks/ingest.py --gather 30    # both at once

Router and daemons run as users start them, and one more process plays the stations, `accelerate` times as fast as
life. To the daemons 1,000 stations at 50 samples a second are as 50,000 at one, but for their memory.
"""

import argparse
import asyncio
import json
import multiprocessing
import os
import platform
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from site_load import SETTLE_S, Played, play, prepare
from site_processes import PATIENCE_S, Site, cpu_and_memory, free_endpoint, started

from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.bus.zenoh.link import connect_client

HEALTH_S = 2.0
"""The rate is found to this."""


async def run(folder: Path, load: list[Played], given: argparse.Namespace) -> dict[str, Any]:
    """Figures of one run."""
    endpoint = free_endpoint()
    daemons = {"historian": ["historian"], "detector": ["detector", "--station", str(folder / "stations")]}
    daemons = {name: words for name, words in daemons.items() if given.daemon in {name, None}}
    commands = {"router": ["router"], **daemons}
    tables: dict[str, dict[str, object]] = {
        "detector": {"state_dir": str(folder / "state")},
        "historian": {"folder": str(folder / "history")},
        "health": {"period_s": HEALTH_S},
    }
    samples = sum(len(each.recording) for each in load)
    with started(commands, endpoint, **tables) as running, await connect_client(endpoint) as bus:
        site = Site(bus, {})
        hearing = [asyncio.create_task(site.hear_verdicts()), asyncio.create_task(site.hear_statuses())]
        await site.wait_for(len(load) * ("detector" in daemons), int("historian" in daemons))
        sent_file = folder / "sent.npz"
        player = multiprocessing.get_context("spawn").Process(
            target=play, args=(endpoint, load, given.accelerate, sent_file, given.gather), daemon=True
        )
        before = {name: cpu_and_memory(process.pid)[0] for name, process in running.items()}
        player.start()
        through_s = dict.fromkeys(daemons, 0.0)
        async with asyncio.timeout(PATIENCE_S + given.seconds / given.accelerate):
            while not sent_file.exists() or not all(through_s.values()):
                have = {
                    "detector": all(site.judged.get(each.name, 0.0) >= each.begin_s + given.seconds for each in load),
                    "historian": site.figures.get((SITE, "historian"), {}).get("committed", 0.0) - len(site.arrivals)
                    >= samples,  # it keeps verdicts, too
                }
                for name in daemons:
                    if have[name] and not through_s[name]:
                        through_s[name] = time.monotonic()
                await asyncio.sleep(0.05)
        after = {name: cpu_and_memory(process.pid) for name, process in running.items()}
        await asyncio.to_thread(player.join)
        for task in hearing:
            task.cancel()
        await asyncio.gather(*hearing, return_exceptions=True)
    with np.load(sent_file) as sent:
        sent_s, late_s = sent["sent_s"], float(sent["late_s"])
    begin_s, end_s = float(sent_s.min()), float(sent_s.max())
    return {
        "samples": samples,
        "sent_per_s": round(samples / (end_s - begin_s)),
        "player_late_s": round(late_s, 2),
        "taken_per_s": {name: round(samples / (at_s - begin_s)) for name, at_s in through_s.items()},
        "behind_s": {name: round(at_s - end_s, 1) for name, at_s in through_s.items()},
        "cpu_us_a_sample": {
            name: round(1e6 * (cpu_s - before[name]) / samples, 2) for name, (cpu_s, _) in after.items()
        },
        "memory_mb": {name: round(memory) for name, (_, memory) in after.items()},
        "verdicts": len(site.arrivals),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stations", type=int, default=1000)
    parser.add_argument("--seconds", type=int, default=1200, help="of each station")
    parser.add_argument("--accelerate", type=float, default=50.0, help="samples a second of each station")
    parser.add_argument("--gather", type=int, default=10, help="samples in a message")
    parser.add_argument("--daemon", choices=["detector", "historian"], help="this one alone; both if not given")
    given = parser.parse_args()
    load_before = os.getloadavg()[0]
    folder = Path(tempfile.mkdtemp(prefix="wetwell-ingest-"))
    try:
        figures = asyncio.run(run(folder, prepare(folder, given.stations, given.seconds), given))
    finally:
        shutil.rmtree(folder)
    machine = {"cores": os.cpu_count(), "python": platform.python_version()}
    print(
        json.dumps(
            {**vars(given), "settle_s": SETTLE_S, **figures}
            | {"load": {"before": load_before, "after": os.getloadavg()[0]}, "machine": machine},
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
