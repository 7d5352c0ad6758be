"""Verdicts of several detectors on any number of recordings, scored against truth that no detector sees."""

import contextlib
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

from pydantic import TypeAdapter

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.evaluation.backtest import Outcome, outcome, summary
from wetwell.detector.evaluation.methods import DETECTORS
from wetwell.detector.evaluation.scores import in_order_of_time, without_truth
from wetwell.detector.stream.block import blocks
from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.reading import PLAIN, Reading
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station, load_station
from wetwell.protocols.timestamps import LEARNING_S
from wetwell.services.batch.dataset import MANIFEST, read_manifest
from wetwell.services.batch.journal import Journal, fingerprint, open_journal
from wetwell.services.batch.own_methods import Method, method_identity, method_named
from wetwell.services.batch.parallel import Failure, refuse_if_all, work_through
from wetwell.services.reports.backtest_page import backtest_page
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

BACKTEST_SCHEMA = "wetwell.backtest/1"
BACKTEST_JOURNAL = "backtest.part.jsonl"
OUTCOMES = TypeAdapter(dict[str, Outcome], config={"ser_json_inf_nan": "constants"})


class Source(Protocol):
    """Where a recording with truth comes from; it is sent to a worker, which loads it there."""

    @property
    def name(self) -> str:
        """What the report calls it."""

    @property
    def station(self) -> Station:
        """What the detectors know of the station."""

    def load(self) -> Recording:
        """The recording, with truth columns."""

    def identity(self) -> object:
        """What JSON can hold that changes when the recording does."""


@dataclass(frozen=True, slots=True)
class RecordingFile:
    """A recording on disk; `name` is its path as it was given."""

    station: Station
    path: Path
    name: str
    reading: Reading = PLAIN

    def load(self) -> Recording:
        """Read the file."""
        return self.reading.read_of(self.path, self.station)

    def identity(self) -> object:
        """Place, size and time of change, and how it is read."""
        with contextlib.suppress(OSError):
            stat = self.path.stat()
            return [str(self.path), stat.st_size, stat.st_mtime_ns, self.reading.identity]
        return str(self.path)


@dataclass(frozen=True, slots=True)
class SimulatedRecording:
    """A seed of a scenario; `length_s` None is the scenario's own."""

    station: Station
    scenario: Scenario
    seed: int
    length_s: int | None = None

    @property
    def name(self) -> str:
        """Scenario and seed."""
        return f"{self.scenario.name}, seed {self.seed}"

    def load(self) -> Recording:
        """Simulate it."""
        try:
            simulation = Simulation(self.station, self.scenario, self.seed)
        except ValueError as error:
            raise ConfigError(str(error)) from error
        return simulation.advance(int(self.scenario.duration_s) if self.length_s is None else self.length_s)

    def identity(self) -> object:
        """All that decides what is simulated."""
        return [self.scenario.model_dump(mode="json"), self.seed, self.length_s]


def detector_names(text: str) -> list[str]:
    """Names of detectors in a text with commas, each once; `all` stands for every one, `FILE.py:CLASS` for one's own.

    Raises
    ------
    ConfigError
        If there is none of such a name, or a package that it needs is missing.

    Examples
    --------
    >>> detector_names("wetwell, always_normal")
    ['wetwell', 'always_normal']
    """
    names = list(DETECTORS) if text == "all" else list(dict.fromkeys(name.strip() for name in text.split(",")))
    for name in names:
        method_named(name)
    return names


def sources_of(
    station: Station,
    recordings: Iterable[Path],
    scenarios: Iterable[Scenario],
    seeds: Sequence[int],
    length_s: int | None,
    reading: Reading = PLAIN,
) -> list[Source]:
    """Recordings of a station to judge: files, then every seed of every scenario."""
    sources: list[Source] = [RecordingFile(station, path.absolute(), str(path), reading) for path in recordings]
    sources += [SimulatedRecording(station, plan, seed, length_s) for plan in scenarios for seed in seeds]
    return sources


def items_of(dataset: Path) -> list[RecordingFile]:
    """Recordings of a dataset, each with its own station.

    Raises
    ------
    RecordingError
        If the folder holds no dataset.
    ConfigError
        If a station file cannot be used.
    """
    items = read_manifest(dataset / MANIFEST)["items"]
    paths = [(dataset / item["station_file"], dataset / item["file"]) for item in items]
    return [RecordingFile(load_station(station), path.absolute(), str(path)) for station, path in paths]


def run_backtest(
    sources: Sequence[Source],
    detectors: Sequence[str],
    workers: int,
    learning_s: float = LEARNING_S,
    *,
    scheduler: str | None = None,
    journal: Journal | None = None,
) -> dict[str, Any]:
    """Judge and score all recordings in parallel, with a progress bar on standard error.

    Parameters
    ----------
    sources : sequence of Source
    detectors : sequence of str
    workers : int
    learning_s : float
        Not scored. [s]
    scheduler : str, optional
        As in `work_through`.
    journal : Journal, optional
        Recordings that it has are not judged again.

    Returns
    -------
    result : dict
        As in `backtest.json`: what was judged, the figures of each detector, and the recordings that could not be
        made, read or scored, which are in no figure.

    Raises
    ------
    WetwellError
        If none could; one line.
    """
    how = [version("wetwell"), list(map(method_identity, detectors)), learning_s]
    keys = [fingerprint(how, source.station.model_dump(mode="json"), source.identity()) for source in sources]
    kept = {line["key"]: line["outcomes"] for line in journal.lines} if journal else {}
    done = {number: OUTCOMES.validate_python(kept[key]) for number, key in enumerate(keys) if key in kept}
    if journal:
        journal.begin({"key": keys[number], "outcomes": kept[keys[number]]} for number in done)
    left = [number for number in range(len(sources)) if number not in done]
    failures: dict[int, Failure] = {}
    work = partial(judge, detectors=detectors, learning_s=learning_s)
    tasks = [sources[number] for number in left]
    for place, judged in work_through(work, tasks, len(left), workers, "backtest", scheduler):
        if isinstance(judged, Failure):
            failures[left[place]] = judged
            continue
        done[left[place]] = judged
        if journal:
            journal.add({"key": keys[left[place]], "outcomes": OUTCOMES.dump_python(judged, mode="json")})
    refuse_if_all(list(failures.values()), len(sources))
    return {
        "schema": BACKTEST_SCHEMA,
        "version": version("wetwell"),
        "learning_h": learning_s / 3600.0,
        "recordings": [sources[number].name for number in sorted(done)],
        "failed": [
            {"recording": sources[number].name, "error": failures[number].error} for number in sorted(failures)
        ],
        "detectors": {name: summary([done[number][name] for number in sorted(done)]) for name in detectors},
    }


def write_backtest(
    sources: Sequence[Source],
    detectors: Sequence[str],
    folder: Path,
    workers: int,
    learning_s: float = LEARNING_S,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Run a backtest, or what is missing of it, and write `backtest.json` and `backtest.html`.

    Raises
    ------
    RecordingError
        If the folder or a file cannot be written.
    WetwellError
        If no recording can be scored.
    """
    with open_journal(folder / BACKTEST_JOURNAL, "backtest") as journal:
        result = run_backtest(sources, detectors, workers, learning_s, scheduler=scheduler, journal=journal)
        for name, text in (
            ("backtest.json", json.dumps(result, indent=2, allow_nan=False) + "\n"),
            ("backtest.html", backtest_page(result)),
        ):
            with atomic_file(folder / name) as file:
                file.write(text.encode())
        if not result["failed"]:
            (folder / BACKTEST_JOURNAL).unlink()
    return result


def overview(result: Mapping[str, Any]) -> dict[str, object]:
    """One line a detector, for the terminal."""
    return {
        "recordings": len(result["recordings"]),
        "failed": result["failed"],
        "detectors": [
            {
                "detector": name,
                "runs": figures["runs"],
                "macro_f1": _digits(figures["macro_f1"]),
                "mean": _digits(figures["macro_f1_by_recording"]["mean"]),
                "5 %": _digits(figures["macro_f1_by_recording"]["quantile_5"]),
                "false alarms a day": _digits(figures["false_alarms"]["per_station_day"]),
                "unknown": _digits(figures["abstention"]["unknown"]),
                "missed": sum(found["missed"] for found in figures["detection"].values()),
            }
            for name, figures in result["detectors"].items()
        ],
    }


def judge(source: Source, detectors: Sequence[str], learning_s: float = LEARNING_S) -> dict[str, Outcome]:
    """Outcome of each detector on one recording.

    Raises
    ------
    RecordingError
        If the recording has no truth, or is not of the station.
    """
    return scored(source.load(), source.name, source.station, detectors_named(detectors), learning_s)


def detectors_named(names: Iterable[str]) -> dict[str, Method]:
    """Method of each name."""
    return {name: method_named(name) for name in names}


def scored(
    recording: Recording,
    place: str,
    station: Station,
    detectors: Mapping[str, Method],
    learning_s: float = LEARNING_S,
) -> dict[str, Outcome]:
    """Outcome of each detector on a recording with truth; `place` is what an error calls it.

    Raises
    ------
    RecordingError
        If the recording has no truth.
    """
    for column in (f"truth_pump{pump}_state" for pump in range(1, recording.pumps + 1)):
        if column not in recording.truth:
            raise RecordingError(f"{place}: column '{column}' is missing, so nothing can be scored")
    told = verdicts_on(recording, station, detectors)
    truth = in_order_of_time(recording)
    return {name: outcome(verdicts, truth, spent_s, learning_s) for name, (verdicts, spent_s) in told.items()}


def verdicts_on(
    recording: Recording, station: Station, detectors: Mapping[str, Method]
) -> dict[str, tuple[list[Verdict], float]]:
    """Verdicts of each detector, and the time that it took; the detectors see no truth column. [s]."""
    datasheet = datasheet_of(station)
    judges = {name: method(station.name, datasheet) for name, method in detectors.items()}
    verdicts: dict[str, list[Verdict]] = {name: [] for name in detectors}
    spent_s = dict.fromkeys(detectors, 0.0)
    for block in blocks(without_truth(recording), datasheet.pumps):
        for name, judge_one in judges.items():
            started_s = time.perf_counter()
            verdicts[name].extend(judge_one.update_block(block))
            spent_s[name] += time.perf_counter() - started_s
    for name, judge_one in judges.items():
        verdicts[name].extend(judge_one.finish())
    return {name: (verdicts[name], spent_s[name]) for name in detectors}


def _digits(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
