"""Batch work: a simulated recording, verdicts on a recording."""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import Progress, track

from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import BLOCK_ROWS, blocks
from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.recording import Recording, recording_writer
from wetwell.protocols.station.station_file import Station
from wetwell.simulator.simulation import Simulation

CHUNK_S = 86_400
"""Seconds that are simulated and written at once; bounds the memory, whatever the length of the recording."""


def simulate(simulation: Simulation, seconds: int, out: Path) -> int:
    """Simulate and write a recording with truth columns, with a progress bar on standard error.

    Returns
    -------
    rows : int
        Rows of the recording, one a second.
    """
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("simulating", total=seconds)
        return write_simulated(simulation, seconds, out, lambda done: progress.update(task, completed=done))


def write_simulated(
    simulation: Simulation, seconds: int, out: Path, tell: Callable[[int], None] = lambda _: None
) -> int:
    """Simulate and write a recording with truth columns block by block; `tell` hears the seconds done.

    Returns
    -------
    rows : int
    """
    with recording_writer(out) as write:
        while (left := seconds - simulation.seconds) > 0:
            write(simulation.advance(min(CHUNK_S, left)))
            tell(simulation.seconds)
    return seconds


def detect(station: Station, recording: Recording, out: Path) -> dict[str, object]:
    """Judge a recording, block by block, and write the verdicts, one JSON object a line.

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
    detector = Detector.of(station)
    states: Counter[str] = Counter()
    with atomic_file(out) as file:
        for verdict in _verdicts(detector, recording, len(station.pump)):
            states[verdict.state] += 1
            file.write(verdict.encode() + b"\n")
    return {"verdicts": dict(states), "counts": detector.counts}


def _verdicts(detector: Detector, recording: Recording, pumps: int) -> Iterator[Verdict]:
    taken = track(
        blocks(recording, pumps),
        total=math.ceil(len(recording) / BLOCK_ROWS),
        description="judging",
        console=Console(stderr=True),
        transient=True,
    )
    for block in taken:
        yield from detector.update_block(block)
    yield from detector.finish()
