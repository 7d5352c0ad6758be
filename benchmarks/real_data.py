"""What the detector says of real recordings that nobody here made: one JSON object on standard output.

    python benchmarks/real_data.py FOLDER

FOLDER holds `skab/` (Skoltech Anomaly Benchmark, v0.9) and `whut-pipeline/`, each file gzipped as published.
"""

import argparse
import gzip
import itertools
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.readings import PumpRow, Row
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.importers.skab import read_skab
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S

SKAB_GROUPS = {
    "normal": ["anomaly-free/anomaly-free"],
    "valve before the pump": [f"valve1/{number}" for number in range(16)],
    "valve after the pump": [f"valve2/{number}" for number in range(4)],
    "liquid taken out or put in": [f"other/{number}" for number in (1, 2, 3, 4, 10, 11)],
    "rotor imbalance": [f"other/{number}" for number in range(5, 10)],
    "cavitation": ["other/12", "other/13"],
    "hotter water": ["other/14"],
}
METRES_PER_MPA = 101.97
RATE_HZ = 10
RUN_S = 100
IDLE_S = 60
LEARNING_RUNS = 160
"""More than six hours of a run and a rest in turn."""
WHUT_PUMPS = (1, 2, 3, 4, 5)


def station(name: str, curve: list[float], static_head_m: float, friction_h2_m5: float) -> Station:
    """A rig with one pump; without a wet well, of which the area is a filler."""
    return Station.model_validate(
        {
            "name": name,
            "sump": {"area_m2": 1.0},
            "pump": [{"curve": curve}],
            "rising_main": {"static_head_m": static_head_m, "friction_h2_m5": friction_h2_m5},
        }
    )


def skab(path: Path) -> tuple[list[Verdict], dict[str, Any]]:
    """Verdicts on a file of SKAB, and what came of it; delays are from the first second that is labelled."""
    recording, rig = read_skab(path), station("skab", [20.0, 0.0, -1.2], 0.5, 1.0)
    detector = Detector(rig.name, datasheet_of(rig))
    verdicts = [verdict for row in recording.rows() for verdict in detector.update(row)]
    verdicts += detector.finish()
    labelled_ns = recording.time_ns[recording.truth.get("truth_anomaly", np.zeros(len(recording))) > 0.0]
    changes = [v for v in verdicts if v.evidence.get("early")]
    told_ns = [v.time for v in changes if v.evidence["abnormal"]]
    figures: dict[str, Any] = {
        "states": sorted({v.state for v in verdicts if v.evidence.get("reason") != "begins"}),
        "abnormal": len(told_ns),
    }
    if labelled_ns.size:
        begin_ns, end_ns = int(labelled_ns[0]), int(labelled_ns[-1])
        within = [v for v in changes if v.evidence["abnormal"] and begin_ns <= v.time <= end_ns]
        figures |= {
            "delay_s": round((within[0].time - begin_ns) / NS_PER_S) if within else None,
            "off": within[0].evidence["off"]["flow_m3h"] if within else None,
            "before": sum(time_ns < begin_ns for time_ns in told_ns),
        }
    return verdicts, figures


def whut(folder: Path, pumps: int, learns_from: str) -> list[Verdict]:
    """Verdicts of a detector that has learnt one part of a file, over and over for six hours, on the other part.

    `learns_from`: "every other run" or "the first half".
    """
    (path,) = folder.glob(f"{pumps}beng*.csv.gz")
    flow_m3h, head_m = _whut_readings(path).T
    rig = station("whut", [20.0 * pumps, 0.0, -0.3 * pumps], 0.0, 0.2765 * METRES_PER_MPA)
    runs = [slice(begin, begin + RUN_S) for begin in range(0, len(flow_m3h) - RUN_S + 1, RUN_S)]
    half = len(runs) // 2
    is_alternate = learns_from == "every other run"
    learnt, unseen = (runs[::2], runs[1::2]) if is_alternate else (runs[:half], runs[half:])

    def rows() -> Iterator[PumpRow]:
        for run in [*itertools.islice(itertools.cycle(learnt), LEARNING_RUNS), *unseen]:
            for q, h in zip(flow_m3h[run], head_m[run], strict=True):
                yield PumpRow(50.0, q, h, np.nan, True)
            yield from [PumpRow(0.0, 0.0, 0.0, np.nan, False)] * IDLE_S

    detector = Detector(rig.name, datasheet_of(rig))
    begin_s = LEARNING_RUNS * (RUN_S + IDLE_S)
    verdicts = [
        verdict
        for second, pump in enumerate(rows())
        for verdict in detector.update(Row(second, second * NS_PER_S, np.nan, np.nan, (pump,)))
    ]
    return [verdict for verdict in verdicts if verdict.window[0] >= begin_s * NS_PER_S]


def _whut_readings(path: Path) -> Floats:
    """(n, 2) flow and head by the second, as the rig's first flow meter and pressure gauge show them."""
    with gzip.open(path, "rt") as file:
        names = file.readline().strip().split(",")
        wanted = [names.index("flow1"), names.index("pre1")]
        rows = [[float(cell) for cell in np.array(line.split(","))[wanted]] for line in file if line.strip(", \n")]
    seconds = len(rows) // RATE_HZ
    by_second = np.array(rows[: seconds * RATE_HZ]).reshape(seconds, RATE_HZ, 2).mean(axis=1)
    return np.asarray(by_second * [1.0, METRES_PER_MPA])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    told = {
        group: {name: skab(folder / "skab" / f"{name}.csv.gz")[1] for name in names}
        for group, names in SKAB_GROUPS.items()
    }
    states = {
        part: {
            pumps: Counter(verdict.state for verdict in whut(folder / "whut-pipeline", pumps, part))
            for pumps in WHUT_PUMPS
        }
        for part in ("every other run", "the first half")
    }
    print(json.dumps({"benchmark": "real_data", "skab": told, "whut": states}, indent=2))


if __name__ == "__main__":
    main()
