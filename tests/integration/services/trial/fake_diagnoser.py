"""Stands in for the diagnosis in tests: answers by what FAKE_MODE says; a spy keeps what it was given.

`perfect` reads the labels of the trial's folder, as no real diagnosis may.
"""

import argparse
import hashlib
import json
import os
import sys
from pathlib import Path


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--station", type=Path)
    parser.add_argument("--recording", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--without", action="append", default=[])
    parser.add_argument("--only", action="append", default=[])
    given = parser.parse_args()
    mode, folder = os.environ["FAKE_MODE"], Path(os.environ["FAKE_FOLDER"])
    with (folder / "spy.jsonl").open("a") as spy:
        spy.write(
            json.dumps(
                {
                    "files": sorted(path.name for path in Path().iterdir()),
                    "without": given.without,
                    "only": given.only,
                }
            )
            + "\n"
        )
    if mode == "broken":
        sys.exit("cannot do it")
    given.out.mkdir()
    report = {
        "schema": "wetwell.gap-report/2",
        "verdict": "none",
        "where": [],
        "effects": [],
        "gap": {"shrinkage": 0.0},
    }
    if mode == "perfect":
        recording = hashlib.sha256(given.recording.read_bytes()).hexdigest()
        labels = next(
            labels
            for labels in map(json.loads, (path.read_text() for path in (folder / "sealed").iterdir()))
            if labels["sha256"]["recording.parquet"] == recording
        )
        is_known = labels["kind"] in {"single", "pair", "triple"}
        report["verdict"] = "effect" if is_known else "none" if labels["kind"] == "none" else "unknown"
        report["where"] = [{"component": component} for component in labels["components"]]
        names = labels["names"] if is_known else []
        report["posterior"] = [{"verdict": report["verdict"], "effects": names, "probability": 1.0}]
        report["gap"] = {"before": 5.0, "after": 1.0, "floor": 1.0, "shrinkage": 1.0}
        if is_known:
            report["effects"] = [
                {
                    "name": name,
                    "parameters": {
                        key: {"value": value, "ci": [value - 0.01, value + 0.01]}
                        for key, value in labels["parameters"][name].items()
                        if isinstance(value, float)
                    },
                }
                for name in labels["names"]
            ]
        (given.out / "station.toml").write_bytes(given.station.read_bytes())
    (given.out / "report.json").write_text("{" if mode == "garbage" else json.dumps(report))


if __name__ == "__main__":
    main()
