"""A labelled set of recordings on disk: made in parallel, resumable, the same bytes for the same seed.

Each item is three files: the recording, its station file, its scenario file. `manifest.json` names them all, with
their checksums, and appears when all are there; until then `manifest.part.jsonl` remembers which are done.
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import tomli_w

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.station.table import Table
from wetwell.services.batch.journal import Journal, open_journal
from wetwell.services.batch.parallel import Failure, refuse_if_all, work_through
from wetwell.services.batch.simulation import write_simulated
from wetwell.services.security.file_sum import file_sum
from wetwell.simulator.dataset import Item, item_of, labels
from wetwell.simulator.simulation import Simulation

DATASET_SCHEMA = "wetwell.dataset/1"
MANIFEST = "manifest.json"
DATASET_JOURNAL = "manifest.part.jsonl"
FILES = ("file", "station_file", "scenario_file")

Form = Literal["parquet", "csv.gz"]
Entry = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What a set is made from; all but the count decides what item k is.

    Attributes
    ----------
    bases : tuple of Station
    seed, count : int
    length_s : int
        Of each recording. [s]
    form : "parquet" or "csv.gz"
    """

    bases: tuple[Station, ...]
    seed: int
    count: int
    length_s: int
    form: Form

    @property
    def header(self) -> dict[str, Any]:
        """The plan as the manifest says it, without the count."""
        return {
            "schema": DATASET_SCHEMA,
            "version": version("wetwell"),
            "seed": self.seed,
            "length_s": self.length_s,
            "format": self.form,
            "base_stations": [_plain(base) for base in self.bases],
        }


def make_dataset(plan: Plan, folder: Path, workers: int, scheduler: str | None = None) -> dict[str, object]:
    """Make a set, or what is missing of it, with a progress bar on standard error.

    Returns
    -------
    summary : dict
        Items, how many were there already, items by class, rows, and those that failed, with their errors. With a
        failed item there is no manifest yet; the next run makes what is missing.

    Raises
    ------
    ConfigError
        If the folder holds another set, or another run works in it.
    RecordingError
        If the folder cannot be written.
    WetwellError
        If no item can be made.
    KeyboardInterrupt
        On Ctrl-C; what is whole stays.
    """
    with open_journal(folder / DATASET_JOURNAL, "dataset") as journal:
        known = _known_entries(plan, folder, journal)
        for half in folder.glob(".*.part"):
            half.unlink(missing_ok=True)
        journal.begin([plan.header, *known.values()])
        entries: dict[int, Entry] = {}
        failures: dict[int, Failure] = {}
        kept = 0
        tasks = ((number, known.get(number)) for number in range(plan.count))
        work = partial(_make, plan, folder.absolute())
        for number, made in work_through(work, tasks, plan.count, workers, "dataset", scheduler):
            if isinstance(made, Failure):
                failures[number] = made
                continue
            entry, was_kept = made
            entries[number] = entry
            kept += was_kept
            if not was_kept:
                journal.add(entry)
        refuse_if_all(list(failures.values()), plan.count)
        items = [entries[number] for number in sorted(entries)]
        counts = Counter(item["class"] for item in items)
        classes = {label: counts[label] for label in labels() if counts[label]}
        if not failures:
            manifest = plan.header | {"count": plan.count, "classes": classes, "items": items}
            with atomic_file(folder / MANIFEST) as file:
                file.write(json.dumps(manifest, indent=1).encode() + b"\n")
            (folder / DATASET_JOURNAL).unlink()
    return {
        "dataset": str(folder),
        "items": len(items),
        "kept": kept,
        "rows": sum(item["rows"] for item in items),
        "classes": classes,
        "failed": [{"item": number, "error": failures[number].error} for number in sorted(failures)],
    }


def check_dataset(folder: Path) -> dict[str, object]:
    """Compare every file of a set with its checksum.

    Raises
    ------
    RecordingError
        If there is no manifest, or a file is missing or changed; names the first and counts the rest.
    """
    manifest = read_manifest(folder / MANIFEST)
    faults: list[str] = []
    items = manifest["items"]
    try:
        for item in items:
            for key in FILES:
                name = str(item[key])
                path = folder / name
                if Path(name).name != name:
                    faults.append(f"{folder / MANIFEST}: '{name}' is not a file of this folder")
                elif not path.is_file():
                    faults.append(f"{path}: is missing")
                elif file_sum(path) != item["sha256"][key]:
                    faults.append(f"{path}: is not what the manifest says, its SHA-256 differs")
    except (KeyError, TypeError) as error:
        raise RecordingError(f"{folder / MANIFEST}: is not a manifest of '{DATASET_SCHEMA}': {error}") from error
    if faults:
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        raise RecordingError(f"{faults[0]}{more}")
    return {
        "dataset": str(folder),
        "items": len(items),
        "files": len(FILES) * len(items),
        "state": "as the manifest says",
    }


def _plain(table: Table) -> dict[str, Any]:
    """A table as TOML and JSON can hold it."""
    plain: dict[str, Any] = table.model_dump(mode="json", exclude_none=True)
    return plain


def read_manifest(path: Path) -> dict[str, Any]:
    """What the manifest of a dataset says.

    Raises
    ------
    RecordingError
        If it cannot be read or is none.
    """
    try:
        manifest = json.loads(path.read_bytes())
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{path}: is not JSON: {error}") from error
    if (
        not isinstance(manifest, dict)
        or manifest.get("schema") != DATASET_SCHEMA
        or not isinstance(manifest.get("items"), list)
    ):
        raise RecordingError(f"{path}: is not a manifest of '{DATASET_SCHEMA}'")
    return manifest


def _known_entries(plan: Plan, folder: Path, journal: Journal) -> dict[int, Entry]:
    """Entries of an earlier run by number, if it was of this plan and version.

    Raises
    ------
    ConfigError
        If the folder holds a set of another plan.
    """
    known: dict[int, Entry] = {}
    if (folder / MANIFEST).exists():
        manifest = read_manifest(folder / MANIFEST)
        if _is_same(manifest, plan, folder):
            known |= {item["number"]: item for item in manifest["items"]}
    lines = journal.lines
    if lines and _is_same(lines[0], plan, folder):
        known |= {item["number"]: item for item in lines[1:]}
    return known


def _is_same(header: dict[str, Any], plan: Plan, folder: Path) -> bool:
    for key, value in plan.header.items():
        if key != "version" and header.get(key) != value:
            raise ConfigError(f"{folder}: holds a dataset with another {key.replace('_', ' ')}; take another folder")
    return bool(header["version"] == plan.header["version"])


def _make(plan: Plan, folder: Path, task: tuple[int, Entry | None]) -> tuple[Entry, bool]:
    """Entry of one item, and whether its files were there already; a task is its number and what is known of it."""
    number, known = task
    try:
        item = item_of(plan.bases, plan.seed, number, plan.length_s)
        simulation = Simulation(item.station, item.scenario, item.seed)
    except ValueError as error:
        raise ConfigError(f"item {number}: {error}") from error
    entry = _entry(item, plan)
    if known is not None and _is_whole(folder, entry, known):
        return known, True
    _write_toml(folder / entry["station_file"], item.station)
    _write_toml(folder / entry["scenario_file"], item.scenario)
    write_simulated(simulation, plan.length_s, folder / entry["file"])
    return entry | {"sha256": {key: file_sum(folder / entry[key]) for key in FILES}}, False


def _entry(item: Item, plan: Plan) -> Entry:
    stem = f"{item.number:06}"
    return {
        "number": item.number,
        "file": f"{stem}.{plan.form}",
        "station_file": f"{stem}.station.toml",
        "scenario_file": f"{stem}.scenario.toml",
        "class": item.label,
        "kinds": [fault.kind for fault in item.scenario.fault],
        "seed": item.seed,
        "rows": plan.length_s,
        "station": _plain(item.station),
        "scenario": _plain(item.scenario),
    }


def _is_whole(folder: Path, entry: Entry, known: Entry) -> bool:
    sums = known.get("sha256", {})
    return known == entry | {"sha256": sums} and all(
        (folder / entry[key]).is_file() and file_sum(folder / entry[key]) == sums.get(key) for key in FILES
    )


def _write_toml(path: Path, table: Table) -> None:
    with atomic_file(path) as file:
        tomli_w.dump(_plain(table), file)


def plan_of(bases: Sequence[Station], seed: int, count: int, days: float, form: Form) -> Plan:
    """Plan of a set, checked by sampling its first item.

    Raises
    ------
    ConfigError
        If no item can be made of it.
    """
    plan = Plan(bases=tuple(bases), seed=seed, count=count, length_s=round(days * 86_400), form=form)
    try:
        item_of(plan.bases, seed, 0, plan.length_s)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    return plan
