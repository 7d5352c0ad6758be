"""Batch work: a simulated recording, verdicts on a recording."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress, track

from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.messages import Verdict
from wetwell.protocols.recording import Recording, write_recording
from wetwell.protocols.station import Station
from wetwell.simulator.simulation import Simulation

CHUNK_S = 21_600


def simulate(simulation: Simulation, seconds: int, out: Path) -> Recording:
    """Simulate and write a recording with truth columns, with a progress bar on standard error."""
    parts = []
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("simulating", total=seconds)
        while (left := seconds - simulation.seconds) > 0:
            parts.append(simulation.advance(min(CHUNK_S, left)))
            progress.update(task, completed=simulation.seconds)
    recording = Recording(
        time_ns=np.concatenate([part.time_ns for part in parts]),
        columns={name: np.concatenate([part.columns[name] for part in parts]) for name in parts[0].columns},
        truth={name: np.concatenate([part.truth[name] for part in parts]) for name in parts[0].truth},
    )
    write_recording(recording, out)
    return recording


def detect(station: Station, recording: Recording, out: Path) -> dict[str, object]:
    """Judge a recording with the streaming detector and write the verdicts, one JSON object a line.

    The file appears whole or not at all.

    Returns
    -------
    summary : dict
        Counts of verdicts by state and of samples and values by mark.

    Raises
    ------
    RecordingError
        If the verdicts cannot be written.
    """
    detector = Detector(station.name, nominal_of(station))
    states: Counter[str] = Counter()
    partial = out.with_name(f".{out.name}.part")
    try:
        with partial.open("wb") as file:
            for verdict in _verdicts(detector, station, recording):
                states[verdict.state] += 1
                file.write(verdict.encode() + b"\n")
        partial.replace(out)
    except OSError as error:
        raise RecordingError(f"{out}: cannot be written: {error.strerror or error}") from error
    finally:
        partial.unlink(missing_ok=True)
    return {"verdicts": dict(states), "counts": detector.counts}


def _verdicts(detector: Detector, station: Station, recording: Recording) -> Iterator[Verdict]:
    samples = track(
        recording.samples(station.name),
        total=len(recording),
        description="judging",
        console=Console(stderr=True),
        transient=True,
    )
    for sample in samples:
        yield from detector.update(sample)
    yield from detector.finish()
