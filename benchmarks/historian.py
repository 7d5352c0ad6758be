"""Speed and size of the historian: rows in, questions, rollover, bytes a station-day. Prints one JSON object."""

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import typer

from wetwell.protocols.history_messages import History, HistoryQuery
from wetwell.services.historian.core import Historian
from wetwell.services.historian.folder_store import FolderStore
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store import DAY_NS, Batch, Store
from wetwell.services.presets import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

STATIONS = 1_000
SECONDS = 60
BATCH = 20_000


def main(days: int = 4, seed: int = 1) -> None:
    plant = Simulation(find_station("alpha"), find_scenario("nominal"), seed)
    recording = plant.advance(days * 86_400)
    figures: dict[str, object] = {"pumps": 3, "days": days, "seed": seed}
    with tempfile.TemporaryDirectory() as folder:
        figures["site"] = site(FolderStore(Path(folder)), plant)
    with tempfile.TemporaryDirectory() as folder:
        figures["batches"] = batches(FolderStore(Path(folder)), Samples.of_recording(recording))
    with tempfile.TemporaryDirectory() as folder:
        store = FolderStore(Path(folder))
        write(store, Samples.of_recording(recording).rows("alpha"))
        live = store.live.size_bytes() / days
        start_ns = int(recording.time_ns[0])
        figures["live"] = questions(store, start_ns + (days - 1) * DAY_NS)
        rolled = 0
        started_s, cpu_s = time.perf_counter(), time.process_time()
        while store.maintain(2**62) is not None:
            rolled += 1
        figures["rollover_of_a_day"] = {
            "wall_s": round((time.perf_counter() - started_s) / rolled, 3),
            "cpu_s": round((time.process_time() - cpu_s) / rolled, 3),
        }
        figures["filed"] = questions(store, start_ns)
        whole = HistoryQuery(kind="samples", start=start_ns, end=start_ns + days * DAY_NS)
        figures["all_days_to_1000_points_ms"] = latency_ms(store, whole)
        sizes = [path.stat().st_size for path in Path(folder).glob("samples/*/*.parquet")]
        figures["bytes_a_station_day"] = {"live": round(live), "filed": round(sum(sizes) / len(sizes))}
        store.close()
    typer.echo(json.dumps(figures, indent=2))


def site(store: FolderStore, plant: Simulation) -> dict[str, object]:
    """A minute of many stations at one sample a second: payloads to rows, then rows to disk once a second."""
    recording = plant.advance(SECONDS)
    names = [f"station-{number}" for number in range(STATIONS)]
    payloads = [[sample.encode() for sample in recording.samples(name)] for name in names]
    historian = Historian(store)
    take_s, commit_s, walls_s = 0.0, 0.0, []
    written = written_bytes()
    for second in range(SECONDS):
        take_s += spent(lambda second=second: [historian.take("samples", each[second]) for each in payloads])[1]
        wall_s, cpu_s = spent(lambda: historian.commit(0))
        commit_s += cpu_s
        walls_s.append(wall_s)
    written = written_bytes() - written
    store.close()
    walls_s.sort()
    samples = STATIONS * SECONDS
    return {
        "stations": STATIONS,
        "taken_per_cpu_s": round(samples / take_s),
        "committed_each_second_per_cpu_s": round(samples / commit_s),
        "cpu_at_1_hz": round((take_s + commit_s) / SECONDS, 3),
        "written_bytes_a_second": round(written / SECONDS),
        "commit_of_a_second_median_ms": round(1e3 * walls_s[SECONDS // 2], 1),
        "commit_of_a_second_longest_ms": round(1e3 * walls_s[-1], 1),
    }


def written_bytes() -> int:
    """What this process has given to the system to write."""
    return int(Path("/proc/self/io").read_text().split("wchar: ")[1].split()[0])


def batches(store: FolderStore, samples: Samples) -> dict[str, int]:
    """Batches of one station, as of an import, and of all stations, as after an outage of the disk."""
    rows = samples.rows("alpha")
    names = [f"station-{number}" for number in range(STATIONS)]
    mixed = [row._replace(station=name) for row in rows[: len(rows) // STATIONS] for name in names]
    of_one, of_all = spent(lambda: write(store, rows)), spent(lambda: write(store, mixed))
    return {
        "one_station_per_s": round(len(rows) / of_one[0]),
        "one_station_per_cpu_s": round(len(rows) / of_one[1]),
        "all_stations_per_s": round(len(mixed) / of_all[0]),
        "all_stations_per_cpu_s": round(len(mixed) / of_all[1]),
    }


def write(store: Store, rows: list) -> None:
    for first in range(0, len(rows), BATCH):
        store.write(Batch(samples=rows[first : first + BATCH]))


def questions(store: Store, day_ns: int) -> dict[str, float]:
    day = {"start": day_ns, "end": day_ns + DAY_NS}
    return {
        "day_to_1000_points_ms": latency_ms(store, HistoryQuery(kind="samples", **day)),
        "last_10_minutes_raw_ms": latency_ms(
            store, HistoryQuery(kind="samples", raw=True, start=day_ns + DAY_NS - 600 * 10**9, end=day_ns + DAY_NS)
        ),
        "hours_of_the_day_ms": latency_ms(store, HistoryQuery(kind="kpi", **day)),
    }


def latency_ms(store: Store, query: HistoryQuery) -> float:
    historian = Historian(store)
    if error := History.decode(historian.answer("alpha", query.encode())).error:
        raise SystemExit(error)
    return round(1e3 * min(spent(lambda: historian.answer("alpha", query.encode()))[0] for _ in range(7)), 1)


def spent(run: Callable[[], object]) -> tuple[float, float]:
    """Time on the wall and of the processor. [s]."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    run()
    return time.perf_counter() - wall_s, time.process_time() - cpu_s


if __name__ == "__main__":
    typer.run(main)
