"""The state of a station's judge on disk: written whole, read back at the start."""

import hashlib
import json
import logging
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic_core import to_json

from wetwell.detector.detector import Detector
from wetwell.detector.snapshot.codec import SnapshotError
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.messages.maintenance import MaintenanceRecord
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.runtime.state_file import FilePlace, StatePlace

log = logging.getLogger(__name__)

CHECKPOINT_SCHEMA = "wetwell.detector-checkpoint/1"


_CHECKSUM = "sha256"
"""Of the other entries of the first line and of the snapshot behind it."""
_OF_EARLIER = {"schema", "answers", "verdicts", "acts"}
"""All entries of a first line of an earlier version, which has no checksum."""


@dataclass(frozen=True)
class Told:
    """What was told: answers to orders that were carried out, by their ids, last verdicts, acts of maintenance.

    `verdicts` are messages as they were told.
    `heard` is time and number of the last sample that came before that, let through by the gate or not.
    `given_up` has times of verdicts of each pump that are kept no more, and that may have been heard or not.
    """

    answers: Mapping[str, Verdict]
    verdicts: Sequence[bytes] = ()
    acts: Sequence[MaintenanceRecord] = ()
    heard: tuple[int, int] | None = None
    given_up: Mapping[int, Sequence[int]] = field(default_factory=dict)


class Checkpoint:
    """What was told, in a first line, and the last snapshot of the detector.

    A file that begins with the snapshot, as version 0.1 wrote it, is read too.

    Parameters
    ----------
    place : StatePlace, optional
        Where it is kept; without it nothing is.
    """

    def __init__(self, place: StatePlace | None) -> None:
        self._place = place
        self._lock = threading.Lock()
        self._encoded = self._written = 0

    def restore(self, detector: Detector) -> Told | None:
        """Let the detector go on from the file.

        What was told before, or None where there is nothing to go on from: a file that is refused is told, put aside
        as `.refused`, and learning starts again.

        Raises
        ------
        ConfigError
            If the place cannot be used.
        """
        data = None if self._place is None else self._place.read()
        if self._place is None or data is None:
            return None
        try:
            told, snapshot = _parted(data)
            detector.restore(snapshot)
        except SnapshotError as error:
            log.warning("%s; kept as %s, learning starts again", error, self._place.put_aside())
            return None
        return told

    def save(self, detector: Detector, told: Told) -> None:
        """Write the state; a disk that refuses is told, and the last file stays."""
        self.write(*self.encode(detector, told))

    def encode(self, detector: Detector, told: Told) -> tuple[int, bytes]:
        """The state as it is now, numbered, for `write`."""
        self._encoded += 1
        if self._place is None:
            return self._encoded, b""
        head = {
            "schema": CHECKPOINT_SCHEMA,
            "answers": {name: answer.model_dump(mode="json") for name, answer in told.answers.items()},
            "verdicts": [payload.decode() for payload in told.verdicts],
            "acts": [record.model_dump(mode="json") for record in told.acts],
            "heard": told.heard,
            "given_up": {str(pump): list(times_ns) for pump, times_ns in told.given_up.items()},
        }
        snapshot = detector.snapshot()
        checked = head | {_CHECKSUM: _checksum(head, snapshot)}
        return self._encoded, to_json(checked) + b"\n" + snapshot

    def write(self, number: int, content: bytes) -> None:
        """Write what `encode` gave, in any thread; what is older than the file is left out."""
        with self._lock:
            if self._place is None or number < self._written:
                return
            try:
                self._place.write(content)
                self._written = number
            except RecordingError as error:
                log.warning("%s", error)


def checkpoint_in(folder: Path | None, station: str) -> Checkpoint:
    """Checkpoint of a station in a folder; without one nothing is kept."""
    file = None if folder is None else FilePlace(folder / f"{station}.detector.json", "detector.state_dir")
    return Checkpoint(file)


def _parted(data: bytes) -> tuple[Told, bytes]:
    """What was told, and the snapshot, in a file."""
    head, _, rest = data.partition(b"\n")
    try:
        header = json.loads(head)
        if not isinstance(header, dict) or header.get("schema") != CHECKPOINT_SCHEMA:
            return Told({}), data
        is_earlier = header.keys() <= _OF_EARLIER
        if header.pop(_CHECKSUM, None) != _checksum(header, rest) and not is_earlier:
            raise SnapshotError("checkpoint: damaged, its checksum differs")
        answers = {name: Verdict.model_validate(answer) for name, answer in header["answers"].items()}
        verdicts = [_as_told(verdict) for verdict in header["verdicts"]]
        acts = [MaintenanceRecord.model_validate(record) for record in header.get("acts", [])]
        return Told(answers, verdicts, acts, _heard(header), _given_up(header)), rest
    except (ValueError, KeyError, AttributeError, TypeError, IndexError, RecursionError) as error:
        raise SnapshotError(f"checkpoint: its first line is damaged ({type(error).__name__})") from error


def _as_told(verdict: str | Mapping[str, Any]) -> bytes:
    """A verdict as it was told; earlier versions kept its fields."""
    return verdict.encode() if isinstance(verdict, str) else Verdict.model_validate(verdict).encode()


def _heard(header: Mapping[str, Any]) -> tuple[int, int] | None:
    """Time and number of the last sample that came; earlier versions did not keep them."""
    heard = header.get("heard")
    return None if heard is None else (int(heard[0]), int(heard[1]))


def _given_up(header: Mapping[str, Any]) -> dict[int, list[int]]:
    """Times of verdicts that are kept no more, by pump; earlier versions did not keep them."""
    given_up = header.get("given_up", {})
    return {int(pump): [int(time_ns) for time_ns in times_ns] for pump, times_ns in given_up.items()}


def _checksum(head: Mapping[str, object], snapshot: bytes) -> str:
    return hashlib.sha256(json.dumps(head, sort_keys=True).encode() + snapshot).hexdigest()


def is_intact(data: bytes) -> bool:
    """Whether a checkpoint is what was written, by its checksums."""
    try:
        _, snapshot = _parted(data)
        head, _, body = snapshot.partition(b"\n")
        header = json.loads(head)
        return bool(hashlib.sha256(body.rstrip(b"\n")).hexdigest() == header["sha256"])
    except (SnapshotError, ValueError, KeyError, TypeError, RecursionError):
        return False
