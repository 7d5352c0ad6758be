"""What a trial is made from, and the folder that holds it."""

import json
import shlex
import sys
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.services.trial.looked_at import reason_to_refuse
from wetwell.sim2real.trial.cases import (
    DEFAULT_STORAGE,
    KINDS,
    CaseKind,
    StoragePlan,
    TrialCase,
    trial_case,
)
from wetwell.sim2real.trial.families import FAMILIES, PlantName

TRIAL_SCHEMA = "wetwell.trial/4"
DIAGNOSE = (sys.executable, "-m", "wetwell.services", "gap", "diagnose")
SLOWEST_S = 3600
"""Rows further apart are daily figures rather than a recording. [s]"""
REPLAY = (sys.executable, "-m", "wetwell.services", "gap", "replay")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialPlan:
    """What a trial is made from.

    Attributes
    ----------
    seed, count : int
    kinds : tuple of CaseKind
    plants : tuple of PlantName
    seconds : int
        Length of each recording. [s]
    storage : StoragePlan
        How recordings are stored.
    effects : tuple of str
        One of them acts in each truth that the library holds; empty: any.
    command : tuple of str
        The diagnosis; it gets `--station FILE --recording FILE --out DIR`, and `--without NAME` or `--only NAME`.
    timeout_s : float
        For one diagnosis. [s]
    replay : tuple of str
        Replays a recording under a station: gets `--station FILE --recording FILE --out FILE`; empty for no figures
        on unseen recordings.
    has_recalibration : bool
        Whether each case is diagnosed once more with the library of `RECALIBRATION` alone.
    """

    seed: int
    count: int
    kinds: tuple[CaseKind, ...] = KINDS
    plants: tuple[PlantName, ...] = ("fine",)
    seconds: int = 86_400
    storage: StoragePlan = DEFAULT_STORAGE
    effects: tuple[str, ...] = ()
    command: tuple[str, ...] = DIAGNOSE
    replay: tuple[str, ...] = ()
    timeout_s: float = 1800.0
    has_recalibration: bool = False

    @property
    def header(self) -> dict[str, Any]:
        """What decides which case k is, and who diagnoses it."""
        return {
            "schema": TRIAL_SCHEMA,
            "version": version("wetwell"),
            "seed": self.seed,
            "looked_at": reason_to_refuse(self.seed),
            "kinds": list(self.kinds),
            "plants": list(self.plants),
            "length_s": self.seconds,
            "rates_s": list(self.storage.rates_s),
            "values": list(self.storage.values),
            "absent": list(self.storage.absent),
            "metered_share": self.storage.metered_share,
            "effects": list(self.effects) or None,
            "diagnoser": "wetwell gap diagnose" if self.command == DIAGNOSE else shlex.join(self.command),
        }

    def case(self, number: int) -> TrialCase:
        """Case `number`, from 0."""
        return trial_case(
            self.seed,
            number,
            kinds=self.kinds,
            plants=self.plants,
            seconds=self.seconds,
            storage=self.storage,
            effects=self.effects,
        )


def parse_kinds(text: str) -> tuple[CaseKind, ...]:
    """Kinds in a list with commas, each once, in their own order.

    Raises
    ------
    ConfigError
        If one is not known.

    Examples
    --------
    >>> parse_kinds("none,single")
    ('single', 'none')
    """
    named = {part.strip() for part in text.split(",")}
    if unknown := sorted(named - set(KINDS)):
        raise ConfigError(f"--kinds: got '{unknown[0]}', must be of {', '.join(KINDS)}")
    return tuple(kind for kind in KINDS if kind in named)


def parse_effects(text: str, plants: tuple[PlantName, ...]) -> tuple[str, ...]:
    """Effects in a list with commas, of which each plant can show one or more.

    Raises
    ------
    ConfigError
        If no plant knows one of them, or a plant knows none.

    Examples
    --------
    >>> parse_effects("pump_wear, friction_bias", ("fine", "swmm"))
    ('pump_wear', 'friction_bias')
    """
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    known = {name for plant in plants for name in FAMILIES[plant].library}
    if unknown := [name for name in names if name not in known]:
        raise ConfigError(f"--effects: got '{unknown[0]}', must be of {', '.join(sorted(known))}")
    for plant in plants:
        if not FAMILIES[plant].held_of(names):
            raise ConfigError(f"--effects: got '{text}', of which plant '{plant}' can show none")
    return names


def parse_rates(text: str) -> tuple[int, ...]:
    """Seconds from row to row in a list with commas.

    Raises
    ------
    ConfigError
        If one is not a whole number of seconds from 1 to `SLOWEST_S`.

    Examples
    --------
    >>> parse_rates("1,60")
    (1, 60)
    """
    parts = [part.strip() for part in text.split(",")]
    for part in parts:
        if not part.isdecimal() or not 1 <= int(part) <= SLOWEST_S:
            raise ConfigError(f"--every: got '{part}', must be a whole number of seconds from 1 to {SLOWEST_S}")
    return tuple(dict.fromkeys(map(int, parts)))


def parse_values(text: str) -> tuple[StoredValue, ...]:
    """What rows hold, in a list with commas.

    Raises
    ------
    ConfigError
        If one is not known.

    Examples
    --------
    >>> parse_values("mean,held")
    ('mean', 'held')
    """
    named = [part.strip() for part in text.split(",")]
    known: tuple[StoredValue, ...] = get_args(StoredValue)
    if unknown := [name for name in named if name not in known]:
        raise ConfigError(f"--value: got '{unknown[0]}', must be of {', '.join(known)}")
    return tuple(value for value in known if value in named)


def take_folder(plan: TrialPlan, folder: Path) -> None:
    """Make the folder of a trial, or find that it holds the same one.

    Raises
    ------
    ConfigError
        If it holds another trial.
    RecordingError
        If it cannot be written.
    """
    path = folder / "plan.json"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        before = json.loads(path.read_bytes()) if path.is_file() else plan.header
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be written: {error.strerror or error}") from error
    except ValueError as error:
        raise ConfigError(f"{path}: is not JSON: {error}") from error
    for key, value in plan.header.items():
        if before.get(key) != value:
            raise ConfigError(f"{folder}: holds a trial with another {key.replace('_', ' ')}; take another folder")
    with atomic_file(path) as file:
        file.write(json.dumps(plan.header, indent=1).encode() + b"\n")
