"""Verdicts of several detectors on any number of recordings, scored against truth that no detector sees."""

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

from wetwell.detector.backtest import Outcome, outcome, summary
from wetwell.detector.baselines import DETECTORS, detector_class
from wetwell.detector.block import blocks
from wetwell.detector.nominal import nominal_of
from wetwell.detector.scoring import LEARNING_S, in_order_of_time, without_truth
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.messages import Verdict
from wetwell.protocols.recording import Recording, read_recording
from wetwell.protocols.station import Station, load_station
from wetwell.protocols.whole_file import whole_file
from wetwell.services.backtest_page import backtest_page
from wetwell.services.dataset import MANIFEST, read_manifest
from wetwell.services.parallel import work_through
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SCHEMA = "wetwell.backtest/1"


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


@dataclass(frozen=True, slots=True)
class RecordingFile:
    """A recording on disk."""

    station: Station
    path: Path

    @property
    def name(self) -> str:
        """Path of the file."""
        return str(self.path)

    def load(self) -> Recording:
        """Read the file."""
        return read_recording(self.path)


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


def detector_names(text: str) -> list[str]:
    """Names of detectors in a text with commas, each once; `all` stands for every one.

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
        detector_class(name)
    return names


def sources_of(
    station: Station,
    recordings: Iterable[Path],
    scenarios: Iterable[Scenario],
    seeds: Sequence[int],
    length_s: int | None,
    dataset: Path | None,
) -> list[Source]:
    """Recordings to judge: files, then every seed of every scenario, then the items of a dataset.

    Raises
    ------
    ConfigError
        If there is none.
    RecordingError
        If the folder holds no dataset.
    """
    sources: list[Source] = [RecordingFile(station, path) for path in recordings]
    sources += [SimulatedRecording(station, plan, seed, length_s) for plan in scenarios for seed in seeds]
    if dataset is not None:
        items = read_manifest(dataset / MANIFEST)["items"]
        sources += [
            RecordingFile(load_station(dataset / item["station_file"]), dataset / item["file"]) for item in items
        ]
    if not sources:
        raise ConfigError("backtest: give at least one --recording, --scenario or --dataset")
    return sources


def run_backtest(
    sources: Sequence[Source], detectors: Sequence[str], workers: int, learning_s: float = LEARNING_S
) -> dict[str, Any]:
    """Judge and score all recordings in parallel, with a progress bar on standard error.

    Returns
    -------
    result : dict
        As in `backtest.json`: what was judged, and the figures of each detector.

    Raises
    ------
    WetwellError
        If a recording cannot be made, read or scored; one line.
    """
    work = partial(_judge_numbered, detectors=detectors, learning_s=learning_s)
    done = dict(work_through(work, enumerate(sources), len(sources), workers, "backtest"))
    return {
        "schema": SCHEMA,
        "version": version("wetwell"),
        "learning_h": learning_s / 3600.0,
        "recordings": [source.name for source in sources],
        "detectors": {name: summary([done[number][name] for number in range(len(sources))]) for name in detectors},
    }


def write_backtest(result: Mapping[str, Any], folder: Path) -> None:
    """Write `backtest.json` and `backtest.html`, each whole or not at all.

    Raises
    ------
    RecordingError
        If the folder or a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be written: {error.strerror or error}") from error
    with whole_file(folder / "backtest.json") as file:
        file.write(json.dumps(result, indent=2, allow_nan=False).encode() + b"\n")
    with whole_file(folder / "backtest.html") as file:
        file.write(backtest_page(result).encode())


def overview(result: Mapping[str, Any]) -> dict[str, object]:
    """One line a detector, for the terminal."""
    return {
        "recordings": len(result["recordings"]),
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
        If the recording has no truth or not the pumps of the station.
    """
    recording = source.load()
    if recording.pumps != len(source.station.pump):
        raise RecordingError(
            f"{source.name}: has {recording.pumps} pumps, station '{source.station.name}' {len(source.station.pump)}"
        )
    for column in (f"truth_pump{pump}_state" for pump in range(1, recording.pumps + 1)):
        if column not in recording.truth:
            raise RecordingError(f"{source.name}: column '{column}' is missing, so nothing can be scored")
    told = verdicts_on(recording, source.station, detectors)
    truth = in_order_of_time(recording)
    return {name: outcome(verdicts, truth, spent_s, learning_s) for name, (verdicts, spent_s) in told.items()}


def verdicts_on(
    recording: Recording, station: Station, detectors: Sequence[str]
) -> dict[str, tuple[list[Verdict], float]]:
    """Verdicts of each detector, and the time that it took; the detectors see no truth column. [s]."""
    nominal = nominal_of(station)
    judges = {name: detector_class(name)(station.name, nominal) for name in detectors}
    verdicts: dict[str, list[Verdict]] = {name: [] for name in detectors}
    spent_s = dict.fromkeys(detectors, 0.0)
    for block in blocks(without_truth(recording), nominal.pumps):
        for name, judge_one in judges.items():
            started_s = time.perf_counter()
            verdicts[name].extend(judge_one.take(block))
            spent_s[name] += time.perf_counter() - started_s
    for name, judge_one in judges.items():
        verdicts[name].extend(judge_one.finish())
    return {name: (verdicts[name], spent_s[name]) for name in detectors}


def _judge_numbered(
    task: tuple[int, Source], detectors: Sequence[str], learning_s: float
) -> tuple[int, dict[str, Outcome]]:
    number, source = task
    return number, judge(source, detectors, learning_s)


def _digits(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
