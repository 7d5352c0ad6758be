"""Stations whose data have brought the process down: known by a trace on disk, and left out after some tries."""

import json
import logging
import mmap
from pathlib import Path

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.whole_file import whole_file

log = logging.getLogger(__name__)

NAME_BYTES = 80


class Quarantine:
    """Counts the crashes of each station in a folder; without a folder nothing is kept and nobody is left out.

    While a station is being judged its name stands in a file, `{name}.at`. If the process dies in that moment the
    next one finds it there and counts it. A station that was counted `tries` times is left out until it is released.

    Parameters
    ----------
    folder : Path, optional
        Where the traces are kept.
    name : str
        Of the group of stations that one process judges.
    tries : int
        Crashes after which a station is left out.

    Raises
    ------
    ConfigError
        If the folder cannot be used.
    """

    def __init__(self, folder: Path | None, name: str, tries: int) -> None:
        self._tries = tries
        self._folder = folder
        self._trace: mmap.mmap | None = None
        if folder is None:
            return
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with (folder / f"{name}.at").open("a+b") as file:
                file.truncate(NAME_BYTES)
                self._trace = mmap.mmap(file.fileno(), NAME_BYTES)  # outlives the process, and costs no system call
        except OSError as error:
            raise ConfigError(f"detector.state_dir: {folder}: {error.strerror or error}") from error
        culprit = self._trace[:].decode(errors="replace").strip(" \0")
        if culprit:
            crashes = self._crashes(culprit) + 1
            self._note(culprit, crashes)
            log.error("station '%s': the process died while it was judged (%d of %d)", culprit, crashes, tries)
        self.leave()

    def close(self) -> None:
        """End without a trace."""
        if self._trace is not None:
            self.leave()
            self._trace.close()
            self._trace = None

    def holds(self, station: str) -> bool:
        """Whether a station is left out."""
        return self._crashes(station) >= self._tries

    def release(self, station: str) -> None:
        """Let a station be judged again from the next start on."""
        if self._folder is not None:
            self._path(station).unlink(missing_ok=True)

    def enter(self, station: str) -> None:
        """Leave the trace that a station is being judged."""
        if self._trace is not None:
            self._trace[:] = station.encode().ljust(NAME_BYTES)

    def leave(self) -> None:
        """Take the trace back."""
        if self._trace is not None:
            self._trace[:] = b" " * NAME_BYTES

    def _crashes(self, station: str) -> int:
        try:
            return int(json.loads(self._path(station).read_bytes())["crashes"])
        except (OSError, ValueError, KeyError, TypeError):
            return 0

    def _note(self, station: str, crashes: int) -> None:
        try:
            with whole_file(self._path(station)) as file:
                file.write(json.dumps({"crashes": crashes}).encode())
        except RecordingError as error:
            log.warning("%s", error)

    def _path(self, station: str) -> Path:
        return (self._folder or Path()) / f"{station}.crashes.json"
