"""Which run a data folder holds: one goes on where its history ended, another gets a folder with its own name."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.services.historian.store.opening import open_store
from wetwell.services.runtime.settings import HistorianSettings
from wetwell.simulator.simulation import Simulation

RUN_FILE = "run.json"
MOST_RUNS = 1_000


class RunRecord(BaseModel):
    """What makes a run what it is; kept in its folder.

    Attributes
    ----------
    digest : str
        Of station file, scenario and seed.
    start_ns : int
        Time of the plant's first second.
    is_life : bool
        Whether it runs at the speed of life, and so at the time of day.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, serialize_by_alias=True)

    schema_name: Literal["wetwell.run/1"] = Field("wetwell.run/1", alias="schema")
    station: str
    scenario: str
    seed: int
    digest: str
    start_ns: int
    is_life: bool

    @classmethod
    def of(cls, plant: Simulation, seed: int, *, is_life: bool) -> "RunRecord":
        """Record of a plant at its beginning."""
        texts = (plant.station.model_dump_json(), plant.scenario.model_dump_json(), str(seed))
        return cls(
            station=plant.station.name,
            scenario=plant.scenario.name,
            seed=seed,
            digest=hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16],
            start_ns=plant.start_ns,
            is_life=is_life,
        )

    def is_same(self, other: "RunRecord") -> bool:
        """Whether both are of one run; at the speed of life each start has another time."""
        if (self.digest, self.is_life) != (other.digest, other.is_life):
            return False
        return self.is_life or self.start_ns == other.start_ns


@dataclass(frozen=True)
class RunFolder:
    """Where a run is kept, how many of its seconds were told before, and that in words for people.

    `begin_s` is 0 for one that begins. [s]
    """

    path: Path
    begin_s: int
    words: str


def take_folder(folder: Path, record: RunRecord) -> RunFolder:
    """The folder for a run: the given one if it is empty or holds this run, else the next that is, `folder-2` and on.

    The record is written where the run begins.

    Raises
    ------
    ConfigError
        If a folder cannot be read or written, or the history of this run ends ahead of the time of day.
    """
    held = ""
    for number in range(1, MOST_RUNS):
        path = folder if number == 1 else folder.with_name(f"{folder.name}-{number}")
        found = _record_in(path)
        if found is None and not _holds_something(path):
            _write(path, record)
            words = f"'{path}': a run begins" + (f", for {held}" if held else "")
            return RunFolder(path, 0, words)
        if found is not None and found.is_same(record):
            return _gone_on(path, record)
        held = held or f"'{folder}' holds {_named(found)}"
    raise ConfigError(f"--data: '{folder}' and {MOST_RUNS - 1} folders beside it hold other runs")


def _gone_on(path: Path, record: RunRecord) -> RunFolder:
    with open_store(HistorianSettings(folder=path), alone=False) as store:
        last_ns = store.newest_ns(record.station)
    if last_ns is None or (last_ns < record.start_ns and not record.is_life):
        return RunFolder(path, 0, f"'{path}': a run begins")
    if not record.is_life:
        words = f"'{path}': goes on where its history ended, at {to_iso(last_ns)}"
        return RunFolder(path, (last_ns - record.start_ns) // NS_PER_S + 1, words)
    if last_ns >= record.start_ns:
        raise ConfigError(f"--data: '{path}': its history ends at {to_iso(last_ns)}, which is not yet; set the clock")
    words = f"'{path}': its history goes on after a pause since {to_iso(last_ns)}; the plant begins anew"
    return RunFolder(path, 0, words)


def _record_in(path: Path) -> RunRecord | None:
    try:
        return RunRecord.model_validate_json((path / RUN_FILE).read_bytes())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ConfigError(f"--data: {path / RUN_FILE}: {error.strerror or error}") from error
    except ValidationError as error:
        raise ConfigError(f"--data: {path / RUN_FILE}: {first_fault(error)}") from error


def _holds_something(path: Path) -> bool:
    try:
        return any(path.iterdir())
    except FileNotFoundError:
        return False
    except OSError as error:
        raise ConfigError(f"--data: {path}: {error.strerror or error}") from error


def _named(found: RunRecord | None) -> str:
    if found is None:
        return "something else"
    return f"another run (station '{found.station}', scenario '{found.scenario}', seed {found.seed})"


def _write(path: Path, record: RunRecord) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"--data: {path}: {error.strerror or error}") from error
    with atomic_file(path / RUN_FILE) as file:
        file.write(record.model_dump_json().encode())
