"""Many recordings diagnosed as one batch: a folder of reports each, and one table over all of them."""

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, WetwellError
from wetwell.protocols.recordings.reading import PLAIN, Reading
from wetwell.protocols.station.station_file import Station
from wetwell.services.batch.gap.diagnosis import diagnose_file
from wetwell.services.batch.journal import Journal, fingerprint, open_journal
from wetwell.services.batch.parallel import Failure, refuse_if_all, work_through
from wetwell.services.stations import find_station

DIAGNOSES_SCHEMA = "wetwell.diagnoses/1"
RESULT = "diagnoses.json"
DIAGNOSES_JOURNAL = "diagnoses.part.jsonl"
COLUMNS = ("station_file", "recording")
SUFFIXES = {".csv", ".gz", ".parquet"}


@dataclass(frozen=True, slots=True)
class Case:
    """A recording and its station, which may be a file that could not be read; `name` is that of its folder."""

    name: str
    recording: Path
    station: Station | Failure
    reading: Reading = PLAIN

    def identity(self, *options: object) -> str:
        """Another one where version, station, recording or options are."""
        stat = self.recording.stat() if self.recording.exists() else None
        file = None if stat is None else [stat.st_size, stat.st_mtime_ns]
        station = self.station.model_dump(mode="json") if isinstance(self.station, Station) else None
        return fingerprint(version("wetwell"), station, str(self.recording), file, self.reading.identity, options)


def cases_of(
    station: str | None, recordings: Sequence[Path], table: Path | None, reading: Reading = PLAIN
) -> list[Case]:
    """Cases of recordings under one station, and of the rows of a table.

    Parameters
    ----------
    station : str, optional
        Of the single recordings.
    recordings : sequence of Path
    table : Path, optional
        CSV file with columns `station_file` and `recording`, whose paths count from its place.
    reading : Reading
        Of all of them.

    Raises
    ------
    ConfigError
        If there are single recordings without a station, if the station or the table cannot be used, or two
        recordings have one name.
    """
    cases: list[Case] = []
    if recordings:
        if station is None:
            raise ConfigError("gap diagnose: give --station FILE with --recording")
        plant = find_station(station)
        cases = [Case(_name(path), path.absolute(), plant, reading) for path in recordings]
    if table is not None:
        cases += [_row_case(row, table, reading) for row in _rows(table)]
    names = [case.name for case in cases]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigError(f"gap diagnose: two recordings are called '{twice[0]}', which names their folder")
    return cases


def diagnose_all(
    cases: Sequence[Case],
    out: Path,
    workers: int,
    scheduler: str | None = None,
    *,
    only: Sequence[str] | None = None,
    without: Sequence[str] = (),
) -> dict[str, Any]:
    """Diagnose all cases, or what is missing of them, with a progress bar on standard error.

    Each gets a folder `out/NAME` as `diagnose_file` writes it; `out/diagnoses.json` sums them up.

    Returns
    -------
    result : dict
        What `diagnoses.json` holds: the diagnoses, and those that failed, with their errors.

    Raises
    ------
    ConfigError
        If another run works in the folder.
    WetwellError
        If no recording can be diagnosed.
    """
    out = out.absolute()
    keys = {case.name: case.identity(only, without) for case in cases}
    with open_journal(out / DIAGNOSES_JOURNAL, "batch of diagnoses") as journal:
        told = {line["row"]["name"]: line["row"] for line in _kept(journal, keys, out)}
        failures = {case.name: case.station for case in cases if isinstance(case.station, Failure)}
        left = [case for case in cases if case.name not in told and case.name not in failures]
        work = partial(_diagnose, out, only, without)
        for number, row in work_through(work, left, len(left), workers, "diagnoses", scheduler):
            name = left[number].name
            if isinstance(row, Failure):
                failures[name] = row
            else:
                told[name] = row
                journal.add({"key": keys[name], "row": row})
        names = [case.name for case in cases]
        refuse_if_all([failures[name] for name in names if name in failures], len(names))
        result = {
            "schema": DIAGNOSES_SCHEMA,
            "version": version("wetwell"),
            "diagnoses": [told[name] for name in names if name in told],
            "failed": [{"name": name, "error": failures[name].error} for name in names if name in failures],
        }
        with atomic_file(out / RESULT) as file:
            file.write(json.dumps(result, indent=1).encode() + b"\n")
        if not failures:
            (out / DIAGNOSES_JOURNAL).unlink()
    return result


def _kept(journal: Journal, keys: dict[str, str], out: Path) -> list[dict[str, Any]]:
    """Lines of an earlier run whose reports still count."""
    known = set(keys.values())
    kept = [line for line in journal.lines if line["key"] in known and _has_report(out, line["row"]["name"])]
    journal.begin(kept)
    return kept


def _has_report(out: Path, name: str) -> bool:
    return (out / name / "report.json").is_file()


def _diagnose(out: Path, only: Sequence[str] | None, without: Sequence[str], case: Case) -> dict[str, Any]:
    if isinstance(case.station, Failure):
        raise ConfigError(case.station.error)
    report = diagnose_file(case.station, [case.recording], out / case.name, case.reading, only=only, without=without)
    return {
        "name": case.name,
        "station": report.station,
        "verdict": report.verdict,
        "effects": [effect.name for effect in report.effects],
        "gap_before": report.gap.before,
        "gap_after": report.gap.after,
        "shrinkage": report.gap.shrinkage,
    }


def _name(path: Path) -> str:
    while path.suffix in SUFFIXES:
        path = path.with_suffix("")
    return path.name


def _rows(table: Path) -> list[dict[str, str]]:
    try:
        with table.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            if missing := [column for column in COLUMNS if column not in (reader.fieldnames or ())]:
                raise ConfigError(f"{table}: must have a column '{missing[0]}'")
            return list(reader)
    except (OSError, UnicodeError) as error:
        raise ConfigError(f"{table}: cannot be read: {error}") from error


def _row_case(row: dict[str, str], table: Path, reading: Reading) -> Case:
    recording = table.parent.absolute() / row["recording"]
    try:
        station: Station | Failure = find_station(str(table.parent / row["station_file"]))
    except WetwellError as error:
        station = Failure(str(error))
    return Case(_name(recording), recording, station, reading)
