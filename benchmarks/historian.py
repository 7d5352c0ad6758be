"""Speed and size of the historian: samples in, alone and in blocks, questions, rollover. Prints one JSON object."""

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import typer

from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.recordings.recording import Recording
from wetwell.services.historian.rows import SampleRow, pack
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.service import Historian, PayloadKind
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Batch, Store
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

STATIONS = 1_000
SECONDS = 60
BLOCK = 10
BATCH = 20_000
"""Samples."""


def main(days: int = 4, seed: int = 1) -> None:
    plant = Simulation(find_station("alpha"), find_scenario("nominal"), seed)
    recording = plant.advance(days * 86_400)
    minute = plant.advance(SECONDS)
    figures: dict[str, object] = {"pumps": 3, "days": days, "seed": seed, "samples_in_a_block": BLOCK}
    for name, in_blocks in (("samples", False), ("blocks", True)):
        with tempfile.TemporaryDirectory() as folder:
            of_name: dict[str, object] = {"site": site(FolderStore(Path(folder)), minute, in_blocks=in_blocks)}
        rows = rows_of(recording, in_blocks=in_blocks)
        with tempfile.TemporaryDirectory() as folder:
            of_name["batches"] = batches(FolderStore(Path(folder)), rows)
        with tempfile.TemporaryDirectory() as folder:
            of_name |= days_of(FolderStore(Path(folder)), Path(folder), rows, int(recording.time_ns[0]), days)
        figures[name] = of_name
    typer.echo(json.dumps(figures, indent=2))


def rows_of(recording: Recording, *, in_blocks: bool) -> list[SampleRow]:
    """Rows as they come from samples alone, or as many together as a row takes."""
    if in_blocks:
        return Samples.of_recording(recording).rows("alpha")
    return [pack("alpha", row) for row in recording.rows()]


def days_of(store: FolderStore, folder: Path, rows: list[SampleRow], start_ns: int, days: int) -> dict[str, object]:
    """Questions to days of one station, before and after they have become files; their sizes."""
    write(store, rows)
    live = store.file.size_bytes() / days
    figures: dict[str, object] = {"live": questions(store, start_ns + (days - 1) * DAY_NS)}
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
    sizes = [path.stat().st_size for path in folder.glob("samples/*/*.parquet")]
    figures["bytes_a_station_day"] = {"live": round(live), "filed": round(sum(sizes) / len(sizes))}
    store.close()
    return figures


def site(store: FolderStore, minute: Recording, *, in_blocks: bool) -> dict[str, object]:
    """A minute of many stations at 1 Hz: payloads to rows, then rows to disk once a second.

    In blocks, a tenth of the stations speaks each second.
    """
    seconds: list[list[bytes]] = [[] for _ in range(SECONDS)]
    for number in range(STATIONS):
        samples = list(minute.samples(f"station-{number}"))
        if in_blocks:
            for first in range(0, SECONDS, BLOCK):
                block = SampleBlock.of(samples[first : first + BLOCK])
                seconds[first + number % BLOCK].append(block.encode())
        else:
            for second, sample in enumerate(samples):
                seconds[second].append(sample.encode())
    kind: PayloadKind = "blocks" if in_blocks else "samples"
    historian = Historian(store)
    take_s, commit_s, walls_s = 0.0, 0.0, []
    written = written_bytes()
    for payloads in seconds:
        take_s += spent(lambda payloads=payloads: [historian.handle(kind, payload) for payload in payloads])[1]
        wall_s, cpu_s = spent(lambda: historian.commit(0))
        commit_s += cpu_s
        walls_s.append(wall_s)
    written = written_bytes() - written
    store.close()
    walls_s.sort()
    samples_in_all = STATIONS * SECONDS
    return {
        "stations": STATIONS,
        "taken_per_cpu_s": round(samples_in_all / take_s),
        "committed_each_second_per_cpu_s": round(samples_in_all / commit_s),
        "taken_and_committed_per_cpu_s": round(samples_in_all / (take_s + commit_s)),
        "cpu_at_1_hz": round((take_s + commit_s) / SECONDS, 3),
        "written_bytes_a_second": round(written / SECONDS),
        "commit_of_a_second_median_ms": round(1e3 * walls_s[SECONDS // 2], 1),
        "commit_of_a_second_longest_ms": round(1e3 * walls_s[-1], 1),
    }


def written_bytes() -> int:
    """What this process has given to the system to write."""
    return int(Path("/proc/self/io").read_text().split("wchar: ")[1].split()[0])


def batches(store: FolderStore, rows: list[SampleRow]) -> dict[str, int]:
    """Batches of one station, as of an import, and of all stations, as after an outage of the disk; in samples."""
    names = [f"station-{number}" for number in range(STATIONS)]
    mixed = [row._replace(station=name) for row in rows[: len(rows) // STATIONS] for name in names]
    of_one, of_all = spent(lambda: write(store, rows)), spent(lambda: write(store, mixed))
    size, size_mixed = (sum(row.size for row in several) for several in (rows, mixed))
    return {
        "one_station_per_s": round(size / of_one[0]),
        "one_station_per_cpu_s": round(size / of_one[1]),
        "all_stations_per_s": round(size_mixed / of_all[0]),
        "all_stations_per_cpu_s": round(size_mixed / of_all[1]),
    }


def write(store: Store, rows: list[SampleRow]) -> None:
    step = BATCH // rows[0].size
    for first in range(0, len(rows), step):
        store.write(Batch(samples=rows[first : first + step]))


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
