"""Batch work: a simulated recording."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from wetwell.protocols.recordings.recording import recording_writer
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

    A block is written while the next one is simulated.

    Returns
    -------
    rows : int
    """
    with recording_writer(out) as write, ThreadPoolExecutor(max_workers=1) as beside:
        writing = beside.submit(lambda: None)
        while (left := seconds - simulation.seconds) > 0:
            block = simulation.advance(min(CHUNK_S, left))
            writing.result()
            writing = beside.submit(write, block)
            tell(simulation.seconds)
        writing.result()
    return seconds
