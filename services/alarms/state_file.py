"""The state of the alarms on disk: written whole, with a version; what cannot be read is put aside and told."""

import hashlib
import logging
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from wetwell.protocols.errors import RecordingError, WetwellError, first_fault
from wetwell.services.alarms.registry import RegistryState
from wetwell.services.runtime.state_file import FilePlace, StatePlace

log = logging.getLogger(__name__)

STATE_NAME = "alarms.json"


class StationState(BaseModel):
    """What is kept of one station over a restart; `ahead_ns`: how far its clock is ahead of the time of day."""

    model_config = ConfigDict(extra="forbid")

    time_ns: int | None
    ahead_ns: int | None = None
    seq: int
    last_verdicts_ns: dict[int, int]
    services: list[str]


class SiteState(BaseModel):
    """All that is kept over a restart; on disk the registry is called a book."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)

    version: Literal["wetwell.alarm-state/1"] = "wetwell.alarm-state/1"
    registry: RegistryState = Field(default_factory=RegistryState, alias="book")
    stations: dict[str, StationState] = Field(default_factory=dict)


class KeptSite:
    """The last state in its place; without one nothing is kept. `errors` counts failed writes in a row.

    Parameters
    ----------
    place : StatePlace, optional
    """

    def __init__(self, place: StatePlace | None) -> None:
        self.errors = 0
        self._place = place

    def load(self) -> SiteState | None:
        """The state that was kept; None if there is none, or none that can be read.

        Raises
        ------
        ConfigError
            If the place cannot be used.
        """
        data = None if self._place is None else self._place.read()
        if self._place is None or data is None:
            return None
        try:
            return read_state(data)
        except ValidationError as error:
            fault = first_fault(error)
        except DamagedStateError as error:
            fault = str(error)
        aside = self._place.put_aside()
        log.warning("%s: %s; kept as %s, the alarms begin anew", STATE_NAME, fault, aside)
        return None

    def save(self, state: SiteState) -> None:
        """Write the state; a disk that refuses is told once, and the last file stays."""
        if self._place is None:
            return
        try:
            body = state.model_dump_json().encode()
            self._place.write(body + b"\n" + checksum(body))
        except RecordingError as error:
            if not self.errors:
                log.warning("%s; alarms go on without", error)
            self.errors += 1
        else:
            self.errors = 0


def site_in(folder: Path | None) -> KeptSite:
    """State in a folder; without one nothing is kept."""
    return KeptSite(None if folder is None else FilePlace(folder / STATE_NAME, "alarms.state_dir"))


class DamagedStateError(WetwellError):
    """A state whose checksum differs."""


def checksum(body: bytes) -> bytes:
    """SHA-256 of a state, as it stands in the last line of its file."""
    return hashlib.sha256(body).hexdigest().encode()


def read_state(data: bytes) -> SiteState:
    """State in a file; one of an earlier version has no checksum.

    Raises
    ------
    DamagedStateError
        If it is not what was written.
    ValidationError
        If it is no state.
    """
    body, line, last = data.rpartition(b"\n")
    if not line or not last:
        return SiteState.model_validate_json(data)
    if last != checksum(body):
        raise DamagedStateError("damaged, its checksum differs")
    return SiteState.model_validate_json(body)
