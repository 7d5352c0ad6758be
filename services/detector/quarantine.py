"""Stations whose data have brought the process down: known by a trace on disk, and left out after some tries."""

import json
import logging
import mmap
from pathlib import Path

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.runtime.clock import now_ns

log = logging.getLogger(__name__)

NAME_BYTES = 80


class Quarantine:
    """Counts the crashes of each station in a folder; without a folder nothing is kept and nobody is left out.

    While a station is being judged its name stands in a file, `{name}.at`. If the process dies in that moment the
    next one finds it there and counts it. A station that was counted `tries` times within a window of time is left
    out until it is released.

    Parameters
    ----------
    folder : Path, optional
        Where the traces are kept.
    name : str
        Of the group of stations that one process judges.
    tries : int
        Crashes after which a station is left out.
    window_s : float
        Crashes that are further apart than this are not counted together. [s]

    Raises
    ------
    ConfigError
        If the folder cannot be used.
    """

    def __init__(self, folder: Path | None, name: str, tries: int, window_s: float) -> None:
        self._tries = tries
        self._window_ns = window_s * NS_PER_S
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
            crashes = self._count(culprit, now_ns())
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
        return len(self._crashes_ns(station)) >= self._tries

    def release(self, station: str) -> None:
        """Let a station be judged again from the next start on.

        Raises
        ------
        ConfigError
            If no crash of it is kept.
        """
        if self._folder is None:
            raise ConfigError("detector.state_dir: not set, must name the folder in which the detector keeps crashes")
        try:
            self._path(station).unlink()
        except FileNotFoundError:
            raise ConfigError(f"{self._folder}: keeps no crash of station '{station}', nothing to release") from None

    def enter(self, station: str) -> None:
        """Leave the trace that a station is being judged."""
        if self._trace is not None:
            self._trace[:] = station.encode().ljust(NAME_BYTES)

    def leave(self) -> None:
        """Take the trace back."""
        if self._trace is not None:
            self._trace[:] = b" " * NAME_BYTES

    def _count(self, station: str, time_ns: int) -> int:
        """Note a crash; how many there are now, without those that are too long ago."""
        crashes_ns = [each for each in self._crashes_ns(station) if abs(time_ns - each) <= self._window_ns] + [
            time_ns
        ]
        try:
            with atomic_file(self._path(station)) as file:
                file.write(json.dumps({"crashes_ns": crashes_ns}).encode())
        except RecordingError as error:
            log.warning("%s", error)
        return len(crashes_ns)

    def _crashes_ns(self, station: str) -> list[int]:
        try:
            return [int(each) for each in json.loads(self._path(station).read_bytes())["crashes_ns"]]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return []

    def _path(self, station: str) -> Path:
        return (self._folder or Path()) / f"{station}.crashes.json"
