"""The state of the alarms on disk: written whole, with a version; what cannot be read is put aside and told."""

import logging
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError, first_fault
from wetwell.services.alarms.registry import RegistryState
from wetwell.services.runtime.state_file import put_aside, read_kept

log = logging.getLogger(__name__)


class StationState(BaseModel):
    """What is kept of one station over a restart."""

    model_config = ConfigDict(extra="forbid")

    time_ns: int | None
    seq: int
    last_verdicts_ns: dict[int, int]
    services: list[str]


class SiteState(BaseModel):
    """All that is kept over a restart; on disk the registry is called a book."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)

    version: Literal["wetwell.alarm-state/1"] = "wetwell.alarm-state/1"
    registry: RegistryState = Field(default_factory=RegistryState, alias="book")
    stations: dict[str, StationState] = Field(default_factory=dict)


class StateFile:
    """A file with the last state; without a folder nothing is kept. `errors` counts failed writes in a row."""

    def __init__(self, folder: Path | None) -> None:
        self.errors = 0
        self._path = None if folder is None else folder / "alarms.json"

    def load(self) -> SiteState | None:
        """The state that was kept; None if there is none, or none that can be read.

        Raises
        ------
        ConfigError
            If the folder cannot be used.
        """
        if self._path is None:
            return None
        data = read_kept(self._path, "alarms.state_dir")
        if data is None:
            return None
        try:
            return SiteState.model_validate_json(data)
        except ValidationError as error:
            aside = put_aside(self._path)
            log.warning("%s: %s; kept as %s, the alarms begin anew", self._path.name, first_fault(error), aside)
            return None

    def save(self, state: SiteState) -> None:
        """Write the state; a disk that refuses is told once, and the last file stays."""
        if self._path is None:
            return
        try:
            with atomic_file(self._path) as file:
                file.write(state.model_dump_json().encode())
        except RecordingError as error:
            if not self.errors:
                log.warning("%s; alarms go on without", error)
            self.errors += 1
        else:
            self.errors = 0
