"""How many stations a core bears at one sample a second, duty by duty, without the bus. Prints one JSON object.

python benchmarks/stations_per_core.py --plots docs/images
"""

import argparse
import gc
import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from memory_bus import MemoryBus
from site_load import Played, messages_of, prepare

from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.station.station_file import load_station
from wetwell.services.detector.checkpoint import checkpoint_in
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.reports.charts.bar_chart import bar_chart
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

STATIONS = 100
SECONDS = 1200
GATHER = 10
SITE = 1000
"""Stations of the historian, whose batches are larger the more there are."""
SITE_SECONDS = 60


def spent(work: Callable[[], object]) -> float:
    """CPU time of all threads. [s]."""
    gc.collect()
    gc.freeze()  # what waits here is no garbage, and is not there in a daemon
    begin_s = time.process_time()
    work()
    cpu_s = time.process_time() - begin_s
    gc.unfreeze()
    return cpu_s


def simulator(gather: int) -> float:
    """A plant that lives second by second, with what it says as JSON: µs a sample."""
    plants = [Simulation(find_station("alpha"), find_scenario("nominal"), seed) for seed in range(1, STATIONS + 1)]
    for plant in plants:
        plant.advance(1, truth=False)

    def live() -> None:
        gathered: list[list[Sample]] = [[] for _ in plants]
        for second in range(1, SECONDS // 4 + 1):
            for plant, samples in zip(plants, gathered, strict=True):
                samples.extend(plant.advance(1, truth=False).samples("alpha", first_seq=plant.seconds - 1))
                if second % gather == 0:
                    _ = samples[0].encode() if gather == 1 else SampleBlock.of(samples).encode()
                    samples.clear()

    return 1e6 * spent(live) / (STATIONS * (SECONDS // 4))


def decoding(load: list[Played], gather: int) -> float:
    """From JSON to checked numbers: µs a sample."""
    kind = Sample if gather == 1 else SampleBlock
    payloads = [payload for each in load for payload in messages_of(each, gather)]

    def decode() -> None:
        for payload in payloads:
            kind.decode(payload)

    return 1e6 * spent(decode) / (STATIONS * SECONDS)


def detector(folder: Path, load: list[Played], gather: int) -> float:
    """Decoding, judging, and verdicts as JSON, of stations that have been learnt: µs a sample."""
    kind = Sample if gather == 1 else SampleBlock
    with MemoryBus() as bus:
        judges = [
            StationDetector(
                bus,
                load_station(folder / "stations" / f"{each.name}.toml"),
                checkpoint=checkpoint_in(folder / "state", each.name),
            )
            for each in load
        ]
        messages = [messages_of(each, gather) for each in load]

        def judge() -> None:
            for number in range(len(messages[0])):
                for one, payloads in zip(judges, messages, strict=True):
                    one.handle_payloads([payloads[number]], kind)

        cpu_s = spent(judge)
    return 1e6 * cpu_s / (STATIONS * SECONDS)


def historian(folder: Path, load: list[Played], gather: int) -> float:
    """Decoding, and once a second into the database and onto the disk: µs a sample."""
    each = load[0]
    rows = list(each.recording.samples(each.name, each.begin_s))[:SITE_SECONDS]
    sites = [[row.model_copy(update={"station": f"s{number:05d}"}) for row in rows] for number in range(SITE)]
    store = FolderStore(folder)
    keeper = Historian(store)
    cpu_s = 0.0
    for second in range(SITE_SECONDS):
        if gather == 1:
            payloads = [samples[second].encode() for samples in sites]
        else:  # each second another tenth of the stations speaks
            at, speaking = second // gather * gather, sites[second % gather :: gather]
            payloads = [SampleBlock.of(samples[at : at + gather]).encode() for samples in speaking]

        def keep(payloads: list[bytes] = payloads) -> None:
            for payload in payloads:
                keeper.handle("samples" if gather == 1 else "blocks", payload)
            keeper.commit(0)

        cpu_s += spent(keep)
    store.close()
    return 1e6 * cpu_s / (SITE * SITE_SECONDS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plots", type=Path, help="folder for stations-per-core.svg")
    given = parser.parse_args()
    load_before = os.getloadavg()[0]
    us_a_sample: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory(prefix="wetwell-core-") as name:
        folder = Path(name)
        load = prepare(folder, STATIONS, SECONDS)
        for way, gather in (("one by one", 1), (f"{GATHER} in a message", GATHER)):
            us_a_sample[way] = {
                "simulator": simulator(gather),
                "decoding": decoding(load, gather),
                "detector": detector(folder, load, gather),
                "historian": historian(folder / f"history-{gather}", load, gather),
            }
    stations = {way: {duty: 1e6 / us for duty, us in each.items()} for way, each in us_a_sample.items()}
    if given.plots is not None:
        bars = {way: [value / 1000.0 for value in each.values()] for way, each in stations.items()}
        chart = bar_chart("Stations a core bears at 1 Hz", list(stations["one by one"]), bars, y_label="thousands")
        (given.plots / "stations-per-core.svg").write_text(chart)
    result = {
        "us_a_sample": {way: {duty: round(us, 2) for duty, us in each.items()} for way, each in us_a_sample.items()},
        "stations_a_core": {way: {duty: round(n, -2) for duty, n in each.items()} for way, each in stations.items()},
        "pumps": 3,
        "load": {"before": load_before, "after": os.getloadavg()[0]},
        "machine": {"cores": os.cpu_count(), "python": platform.python_version()},
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
