"""What the detector of a simulated site was given: a branch of samples for each time that it went on from a file."""

import asyncio
import contextlib
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple
from unittest import mock

from wetwell.detector.detector import Detector
from wetwell.protocols.messages.sample import Sample
from wetwell.services.detector.checkpoint import Checkpoint, Told
from wetwell.services.detector.station_detector import StationDetector

Branch = list[Sample]


class GoneOn(NamedTuple):
    """A life of the detector of a station: when it went on from a file, how much that knew, and its branch."""

    at_s: float
    length: int
    branch: Branch


@dataclass
class Judged:
    """Branches of each station, the last one last. A life of the detector adds to its branch.

    Attributes
    ----------
    unknown : list of str
        Stations that have gone on from a state in which no detector has ever been.
    lives : dict
        Those that went on from a file, by station.
    """

    branches: dict[str, list[Branch]] = field(default_factory=dict)
    unknown: list[str] = field(default_factory=list)
    lives: dict[str, list[GoneOn]] = field(default_factory=dict)
    _saved: dict[tuple[str, bytes], tuple[int, int]] = field(default_factory=dict)

    @contextlib.contextmanager
    def watched(self) -> Iterator[None]:
        """Note meanwhile what is judged, saved and taken up."""
        restore, encode, judge = Checkpoint.restore, Checkpoint.encode, StationDetector._judge

        def restored(checkpoint: Checkpoint, detector: Detector) -> Told | None:
            told = restore(checkpoint, detector)
            self._begin(detector, told)
            return told

        def encoded(checkpoint: Checkpoint, detector: Detector, told: Told) -> tuple[int, bytes]:
            branches = self.branches.setdefault(detector._station, [[]])
            number, content = encode(checkpoint, detector, told)
            key = _key(detector._station, told, content.partition(b"\n")[2])
            self._saved[key] = len(branches) - 1, len(branches[-1])
            return number, content

        def judged(station: StationDetector, sample: Sample) -> None:
            self.branches[station.station][-1].append(sample)
            judge(station, sample)

        with contextlib.ExitStack() as patches:
            for target, replacement in (
                ("wetwell.services.detector.checkpoint.Checkpoint.restore", restored),
                ("wetwell.services.detector.checkpoint.Checkpoint.encode", encoded),
                ("wetwell.services.detector.station_detector.StationDetector._judge", judged),
            ):
                patches.enter_context(mock.patch(target, replacement))
            yield

    def _begin(self, detector: Detector, told: Told | None) -> None:
        branches = self.branches.setdefault(detector._station, [])
        if told is None:
            branches.append([])
            return
        saved = self._saved.get(_key(detector._station, told, detector.snapshot()))
        if saved is None:
            self.unknown.append(detector._station)
            branches.append([])
            return
        number, length = saved
        branches.append(branches[number][:length])
        life = GoneOn(asyncio.get_running_loop().time(), length, branches[-1])
        self.lives.setdefault(detector._station, []).append(life)


def once(branch: Sequence[Sample]) -> list[Sample]:
    """Samples of a branch, each once."""
    known: dict[Any, Sample] = {}
    for sample in branch:
        known.setdefault((sample.time, sample.seq), sample)
    return list(known.values())


def _key(station: str, told: Told, snapshot: bytes) -> tuple[str, bytes]:
    """What tells a state from others: that of the detector, and what it has told."""
    answers = sorted((name, answer.encode()) for name, answer in told.answers.items())
    said = repr((answers, list(told.verdicts), [one.encode() for one in told.acts], told.heard))
    return station, hashlib.sha256(said.encode() + snapshot).digest()
