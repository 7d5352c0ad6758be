"""Batch work: verdicts on a recording."""

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import BLOCK_ROWS, blocks
from wetwell.detector.verdict.episodes import EpisodeLog
from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.messages.history import Episode
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.reports.episode_table import episode_page


def detect(station: Station, recording: Recording, out: Path, html: Path | None = None) -> dict[str, Any]:
    """Judge a recording, block by block, and write the verdicts, one JSON object a line.

    The file appears whole or not at all.

    Parameters
    ----------
    station : Station
    recording : Recording
    out : Path
        For the verdicts.
    html : Path, optional
        For a page with the episodes.

    Returns
    -------
    summary : dict
        Counts of verdicts by state and of samples and values by mark; `episodes`, a list of `Episode`.

    Raises
    ------
    RecordingError
        If a file cannot be written.
    """
    detector = Detector.of(station)
    states: Counter[str] = Counter()
    log, found = EpisodeLog(), dict[tuple[str, int], Episode]()
    with atomic_file(out) as file:
        for verdict in _verdicts(detector, recording, len(station.pump)):
            states[verdict.state] += 1
            found |= {(episode.asset, episode.since): episode for episode in log.add(verdict)}
            file.write(verdict.encode() + b"\n")
    found |= {(episode.asset, episode.since): episode for episode in log.standing.values()}
    episodes = sorted(found.values(), key=lambda episode: episode.since)
    if html is not None:
        text = episode_page(station.name, episodes, int(recording.time_ns.min()), int(recording.time_ns.max()))
        with atomic_file(html) as file:
            file.write(text.encode())
    return {"verdicts": dict(states), "counts": detector.counts, "episodes": episodes}


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
