"""The watch of a station on disk: written whole, with a checksum; what cannot be read is put aside and told."""

import hashlib
import logging
from pathlib import Path

from pydantic import ValidationError

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError, first_fault
from wetwell.protocols.station.station_file import Station
from wetwell.services.runtime.state_file import put_aside, read_kept
from wetwell.sim2real.watch.state import WatchState

log = logging.getLogger(__name__)

WATCH_SUFFIX = ".gap.json"


class WatchFile:
    """A file with the state of a station's watch; without a folder nothing is kept. `errors` counts failed writes.

    Parameters
    ----------
    folder : Path or None
    station : Station
        Its file may have changed since: then the watch begins anew.
    """

    def __init__(self, folder: Path | None, station: Station) -> None:
        self.errors = 0
        self._station = station
        self._path = None if folder is None else folder / f"{station.name}{WATCH_SUFFIX}"

    def load(self) -> WatchState:
        """The state that was kept, or that of a station at which nobody has looked.

        Raises
        ------
        ConfigError
            If the folder cannot be used.
        """
        new = WatchState(station=self._station)
        data = None if self._path is None else read_kept(self._path, "watch.state_dir")
        if self._path is None or data is None:
            return new
        try:
            state = read_state(data)
        except ValidationError as error:
            log.warning("%s: %s; kept as %s, begins anew", self._path.name, first_fault(error), put_aside(self._path))
            return new
        except ValueError as error:
            log.warning("%s: %s; kept as %s, begins anew", self._path.name, error, put_aside(self._path))
            return new
        if state.station != self._station:
            log.warning(
                "station '%s': its file has changed: the watch begins anew with the next span", self._station.name
            )
            return new.model_copy(update={"begins_ns": state.begins_ns})
        return state

    def save(self, state: WatchState) -> None:
        """Write the state; a disk that refuses is told once, and the last file stays."""
        if self._path is None:
            return
        try:
            body = state.model_dump_json().encode()
            with atomic_file(self._path) as file:
                file.write(body + b"\n" + _checksum(body))
        except RecordingError as error:
            if not self.errors:
                log.warning("%s; the watch goes on without", error)
            self.errors += 1
        else:
            self.errors = 0


def is_whole(data: bytes) -> bool:
    """Whether a file is what was written, by its checksum."""
    body, _, last = data.rpartition(b"\n")
    return last == _checksum(body)


def read_state(data: bytes) -> WatchState:
    """State in a file.

    Raises
    ------
    ValueError
        If it is not what was written, or no state.
    """
    if not is_whole(data):
        raise ValueError("damaged, its checksum differs")
    return WatchState.model_validate_json(data.rpartition(b"\n")[0])


def _checksum(body: bytes) -> bytes:
    return hashlib.sha256(body).hexdigest().encode()
