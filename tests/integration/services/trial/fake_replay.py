"""Stands in for the replay in tests: says 0.9 of what the recording says for flows, and the rest as recorded."""

import argparse
from dataclasses import replace
from pathlib import Path

from wetwell.protocols.recordings.recording import read_recording, write_recording


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--station", type=Path)
    parser.add_argument("--recording", type=Path)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    recording = read_recording(given.recording)
    columns = {
        name: 0.9 * values if name.endswith("flow_m3h") and "reports" not in given.station.parts else values
        for name, values in recording.columns.items()
    }
    write_recording(replace(recording, columns=columns), given.out)


if __name__ == "__main__":
    main()
