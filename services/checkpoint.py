"""The state of a detector on disk: written whole, read back at the start."""

import contextlib
import logging
from pathlib import Path

from wetwell.detector.pipeline import Detector
from wetwell.detector.snapshot import SnapshotError
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.whole_file import whole_file

log = logging.getLogger(__name__)


class Checkpoint:
    """A file with the last snapshot of one station's detector; without a folder nothing is kept."""

    def __init__(self, folder: Path | None, station: str) -> None:
        self._path = None if folder is None else folder / f"{station}.detector.json"

    def restore(self, detector: Detector) -> bool:
        """Let the detector go on from the file.

        Whether it does: a snapshot that is refused is told, put aside as `.refused`, and learning starts again.

        Raises
        ------
        ConfigError
            If the folder cannot be used.
        """
        if self._path is None:
            return False
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            data = self._path.read_bytes()
        except FileNotFoundError:
            return False
        except OSError as error:
            raise ConfigError(f"detector.state_dir: {self._path}: {error.strerror or error}") from error
        try:
            detector.restore(data)
        except SnapshotError as error:
            aside = self._path.with_suffix(".refused")
            with contextlib.suppress(OSError):
                self._path.replace(aside)
            log.warning("%s; kept as %s, learning starts again", error, aside.name)
            return False
        return True

    def save(self, detector: Detector) -> None:
        """Write the state; a disk that refuses is told, and the last file stays."""
        if self._path is None:
            return
        try:
            with whole_file(self._path) as file:
                file.write(detector.snapshot())
        except RecordingError as error:
            log.warning("%s", error)
