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
import sqlite3
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from site_load import SETTLE_S, Played, play, prepare
from site_processes import Site, daemon, free_endpoint, started
from site_week import memory_of_a_week

from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.bus.zenoh.link import connect_client
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.reports.charts import Series, line_chart


def commands_of(folder: Path) -> dict[str, list[str]]:
    """What a site runs."""
    stations = folder / "stations"
    of_each = [word for path in sorted(stations.iterdir()) for word in ("--station", str(path))]
    return {
        "router": ["router"],
        "historian": ["historian", "--data", str(folder / "history")],
        "alarms": ["alarms", *of_each],
        "detector": ["detector", "--station", str(stations)],
    }


async def observe(folder: Path, load: list[Played], given: argparse.Namespace) -> Site:
    """Run the load against the daemons."""
    tables = {
        "detector": {"state_dir": str(folder / "state"), "checkpoint_s": given.checkpoint_s},
        "alarms": {"state_dir": str(folder / "alarms")},
        "health": {"period_s": given.health_s},
    }
    endpoint, period_s = free_endpoint(), max(given.seconds / given.accelerate / 180.0, 1.0)
    with started(commands_of(folder), endpoint, **tables) as running, await connect_client(endpoint) as bus:
        site = Site(bus, {name: process.pid for name, process in running.items()})
        hearing = [asyncio.create_task(site.hear_verdicts()), asyncio.create_task(site.hear_statuses())]
        begun_s = time.monotonic()
        await site.wait_for(len(load), services=2)
        print(f"all daemons up after {time.monotonic() - begun_s:.1f} s", file=sys.stderr)
        context = multiprocessing.get_context("spawn")
        player = context.Process(
            target=play, args=(endpoint, load, given.accelerate, folder / "sent.npz", given.gather), daemon=True
        )
        player.start()
        await asyncio.sleep(SETTLE_S)
        hearing.append(asyncio.create_task(site.look(period_s)))
        kill_s = time.monotonic() + (given.kill_router or np.inf)
        while player.is_alive():
            if site.router_killed_s is None and time.monotonic() > kill_s:
                running["router"].kill()
                running["router"].wait()
                running["router"] = daemon(commands_of(folder)["router"], endpoint, tables)
                site.router_killed_s, site.pids["router"] = time.monotonic(), running["router"].pid
                site.curve.clear()
            for name, process in running.items():
                if process.poll() is not None:
                    raise SystemExit(f"{name} has ended with code {process.returncode}")
            await asyncio.sleep(0.5)
        hearing.pop().cancel()
        site.look_once()
        await asyncio.sleep(given.health_s + SETTLE_S)  # the last health figures
        for task in hearing:
            task.cancel()
        await asyncio.gather(*hearing, return_exceptions=True)
    return site


def latencies_ms(site: Site, load: list[Played], sent_s: np.ndarray, gather: int) -> np.ndarray:
    """From the put of the message that a verdict stands on to the arrival of the verdict."""
    place = {each.name: (column, int(each.recording.time_ns[0])) for column, each in enumerate(load)}
    found = []
    for arrived_s, verdict in site.arrivals:
        column, first_ns = place[verdict.station]
        row = (verdict.time - first_ns) // NS_PER_S // gather
        if 0 <= row < len(sent_s):  # else one that was told again after the start
            found.append(1e3 * (arrived_s - sent_s[row, column]))
    return np.array(found)


def silence_s(site: Site) -> float | None:
    """From the death of the router to the first verdict after it. [s]."""
    if site.router_killed_s is None:
        return None
    after_s = np.array([arrived_s for arrived_s, _ in site.arrivals]) - site.router_killed_s
    return round(float(np.min(after_s[after_s > 0.0], initial=np.inf)), 1)


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
        return int(database.execute("SELECT coalesce(sum(size), 0) FROM sample").fetchone()[0])


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
    parser.add_argument("--gather", type=int, default=1, help="samples in a message")
    parser.add_argument("--health-s", type=float, default=10.0, help="between health messages of a service")
    parser.add_argument("--checkpoint-s", type=float, default=60.0, help="between saved states of a station")
    parser.add_argument(
        "--kill-router", type=float, metavar="S", help="so long after the first sample; it starts anew"
    )
    parser.add_argument("--plots", type=Path, help="folder for soak.svg and soak-cpu.svg")
    parser.add_argument("--week", type=int, metavar="DAYS", help="so many days in one process instead")
    arguments = parser.parse_args()
    if arguments.week is not None:
        with tempfile.TemporaryDirectory(prefix="wetwell-week-") as week_folder:
            print(json.dumps(memory_of_a_week(Path(week_folder), arguments.stations, arguments.week), indent=2))
        return
    stations = arguments.stations
    load_before = os.getloadavg()[0]
    folder = Path(tempfile.mkdtemp(prefix="wetwell-site-"))
    try:
        load = prepare(folder, stations, arguments.seconds)
        site = asyncio.run(observe(folder, load, arguments))
        with np.load(folder / "sent.npz") as sent:
            sent_s, late_s = sent["sent_s"], float(sent["late_s"])
        in_database = kept(folder)
    finally:
        shutil.rmtree(folder)
    latency_ms, judged = latencies_ms(site, load, sent_s, arguments.gather), site.summed("detector")
    judged["samples"] -= sum(each.begin_s for each in load)
    if arguments.plots is not None:
        plots(site.curve, arguments.plots)
    result = {
        "stations": stations,
        "seconds": arguments.seconds,
        "samples_per_s": stations * arguments.accelerate,
        "samples_a_message": arguments.gather,
        "sent": sum(each.seconds for each in load),
        "bytes_a_sample": len(next(load[0].recording.samples(load[0].name)).encode()),
        "sent_late_at_most_s": round(late_s, 3),
        "verdicts": len(latency_ms),
        "sample_to_verdict_ms": {
            f"p{share}": round(float(np.percentile(latency_ms, share)), 1) for share in (50, 90, 99, 100)
        }
        if len(latency_ms)
        else {},
        "silence_after_the_router_s": silence_s(site),
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
