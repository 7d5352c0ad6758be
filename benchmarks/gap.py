"""Speed and memory of the diagnosis: one JSON object on standard output.

    python benchmarks/gap.py

Each length runs in a process of its own, from reading the recording to the written report, with the station alpha,
a rougher main and a damped level sensor. Seconds are given on the wall and as the processor counts them.
"""

import argparse
import importlib.metadata
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from wetwell.protocols.recordings.recording import write_recording
from wetwell.protocols.station.station_file import EffectTable
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

AIMS = {1.5: (10.0, 2.0), 26.0: (60.0, 2.0)}
"""Most seconds and GB by days."""
EFFECTS = ({"name": "friction_bias", "factor": 1.25}, {"name": "level_sensor_lag", "lag_s": 6.0})


def diagnosed(days: float, seed: int) -> dict[str, object]:
    """Figures of one diagnosis by the command line."""
    tables = tuple(EffectTable.model_validate(effect) for effect in EFFECTS)
    station = find_station("alpha").model_copy(update={"effect": tables})
    with tempfile.TemporaryDirectory(prefix="gap-") as room:
        recording, out = Path(room) / "field.parquet", Path(room) / "out"
        seconds = round(days * 86_400)
        write_recording(Simulation(station, find_scenario("nominal"), seed).advance(seconds, truth=False), recording)
        command = [sys.executable, "-m", "wetwell.services", "gap", "diagnose", "--station", "alpha"]
        began_s, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(  # noqa: S603 - our own command
            [*command, "--recording", str(recording), "--out", str(out)], check=True, stdout=subprocess.DEVNULL
        )
        wall_s, after = time.perf_counter() - began_s, resource.getrusage(resource.RUSAGE_CHILDREN)
        report = json.loads((out / "report.json").read_bytes())
    most_s, most_gb = AIMS.get(days, (None, None))
    return {
        "days": days,
        "wall_s": round(wall_s, 2),
        "processor_s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 2),
        "peak_gb": round(after.ru_maxrss / 1e6, 3),
        "aim_s": most_s,
        "aim_gb": most_gb,
        "told": [effect["name"] for effect in report["effects"]],
    }


def main() -> None:
    """Run all lengths, the shortest first: the peak of memory is that of the largest process so far."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=float, nargs="+", default=[1.5, 26.0])
    parser.add_argument("--seed", type=int, default=11)
    given = parser.parse_args()
    result = {
        "version": importlib.metadata.version("wetwell"),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "seed": given.seed,
        "diagnoses": [diagnosed(days, given.seed) for days in sorted(given.days)],
    }
    json.dump(result, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
