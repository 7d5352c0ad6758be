"""A trial on disk: cases published and sealed, diagnoses by processes of their own, seals opened, scores written.

The folder of a trial holds `plan.json`; `published/case-…/` with station file, recording and `seal.sha256`;
`sealed/case-….json` with the labels; `reports/case-…/` with what the diagnosis wrote; `trial.json` and `trial.html`.
Whatever is whole is kept by the next run with the same plan.
"""

import json
import secrets
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from pydantic import ValidationError

from wetwell.protocols.errors import ConfigError, RecordingError, first_fault
from wetwell.protocols.recording import write_recording
from wetwell.protocols.whole_file import whole_file
from wetwell.services.executors import let_interrupts
from wetwell.services.held_out import held_out_summary, hold_out
from wetwell.services.parallel import Failure, refuse_if_all, work_through
from wetwell.services.trial_page import trial_page
from wetwell.services.twin import hidden_names, recording_of
from wetwell.sim2real.trial.answer import Answer, answer_of
from wetwell.sim2real.trial.cases import KINDS, CaseKind, PlantName, TrialCase, trial_case
from wetwell.sim2real.trial.scores import (
    CaseScore,
    Label,
    chance_level,
    confusion,
    named_shrinkage,
    score_case,
    summary,
)
from wetwell.sim2real.trial.seal import digest, labels_text, opened

SCHEMA = "wetwell.trial/1"
DIAGNOSE = (sys.executable, "-m", "wetwell.services", "gap", "diagnose")
REPLAY = (sys.executable, "-m", "wetwell.services", "gap", "replay")
RECALIBRATION = ("friction_bias", "static_head_bias", "head_sensor_offset", "flow_meter_gain")
"""What anybody would calibrate: the library of the lower bound."""
REPORTS, RECALIBRATED, WHOLE_LIBRARY = "reports", "recalibrated", "whole_library"
"""Folders of diagnoses: as asked, by recalibration only, and of a case with a name left out with nothing left out."""
STATION_FILE, RECORDING_FILE, SEAL_FILE, REPORT_FILE = (
    "station.toml",
    "recording.parquet",
    "seal.sha256",
    "report.json",
)

Job = tuple[TrialCase, str]
"""A case, and the folder of the diagnosis that is meant."""


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
    command: tuple[str, ...] = DIAGNOSE
    replay: tuple[str, ...] = ()
    timeout_s: float = 1800.0
    has_recalibration: bool = False

    @property
    def header(self) -> dict[str, Any]:
        """What decides which case k is, and who diagnoses it."""
        return {
            "schema": SCHEMA,
            "version": version("wetwell"),
            "seed": self.seed,
            "kinds": list(self.kinds),
            "plants": list(self.plants),
            "length_s": self.seconds,
            "diagnoser": "wetwell gap diagnose" if self.command == DIAGNOSE else shlex.join(self.command),
        }

    def case(self, number: int) -> TrialCase:
        """Case `number`, from 0."""
        return trial_case(self.seed, number, kinds=self.kinds, plants=self.plants, seconds=self.seconds)


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


def run_trial(plan: TrialPlan, folder: Path, workers: int, scheduler: str | None = None) -> dict[str, Any]:
    """Run a trial, or what is missing of it, with a progress bar on standard error.

    Returns
    -------
    result : dict
        What `trial.json` holds, without the single cases. A case that could not be made, diagnosed or replayed is in
        no score; `failed` names it, and the next run tries it again.

    Raises
    ------
    ConfigError
        If the folder holds another trial.
    RecordingError
        If a sealed file is not what was published.
    WetwellError
        If no case can be made or diagnosed.
    """
    folder = folder.absolute()
    _take_folder(plan, folder)
    failed: dict[str, Failure] = {}

    def each(title: str, work: Callable[[Job], None], jobs: Iterable[Job]) -> None:
        left = [job for job in jobs if job[0].name not in failed]
        done = work_through(work, left, len(left), min(workers, max(len(left), 1)), title, scheduler)
        found = {left[number][0].name: result for number, result in done if isinstance(result, Failure)}
        refuse_if_all(list(found.values()), len(left))
        failed.update(found)

    cases = [plan.case(number) for number in range(plan.count)]
    deviating = [case for case in cases if case.kind in {"single", "pair"}]
    new = [(case, REPORTS) for case in cases if not _is_published(case, folder)]
    each("cases", partial(_publish, folder), new)
    jobs = [(case, REPORTS) for case in cases]
    if plan.has_recalibration:
        jobs += [(case, RECALIBRATED) for case in deviating]
    diagnosis = partial(_diagnose, plan, folder)
    each("diagnoses", diagnosis, [job for job in jobs if not _is_diagnosed(job, folder)])
    named = [(case, WHOLE_LIBRARY) for case in cases if case.without and _told_effect(folder / REPORTS / case.name)]
    each("equivalents", diagnosis, [job for job in named if not _is_diagnosed(job, folder)])
    if plan.replay:
        each("unseen recordings", partial(_hold_out, plan, folder), [(case, REPORTS) for case in deviating])
    return score_trial(plan, folder, failed)


def _is_published(case: TrialCase, folder: Path) -> bool:
    sealed = folder / "sealed" / f"{case.name}.json"
    return (folder / "published" / case.name / SEAL_FILE).is_file() and sealed.is_file()


def _is_diagnosed(job: Job, folder: Path) -> bool:
    case, which = job
    return (folder / which / case.name / REPORT_FILE).is_file()


def _publish(folder: Path, job: Job) -> None:
    publish(job[0], folder)


def _hold_out(plan: TrialPlan, folder: Path, job: Job) -> None:
    case, which = job
    hold_out(case, folder / "published" / case.name, folder / which / case.name, plan.replay)


def publish(case: TrialCase, folder: Path) -> None:
    """Write station file and recording of a case, its labels under seal, and the hash of the seal."""
    published, sealed = folder / "published" / case.name, folder / "sealed" / f"{case.name}.json"
    published.mkdir(parents=True, exist_ok=True)
    sealed.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(published / STATION_FILE) as file:
        tomli_w.dump(case.truth.station.model_dump(mode="json", exclude_none=True), file)
    write_recording(recording_of(case, case.truth), published / RECORDING_FILE)
    labels = {
        "case": case.name,
        "kind": case.kind,
        "plant": case.plant,
        "names": list(case.names),
        "components": list(case.components),
        "parameters": {deviation.name: dict(deviation.parameters) for deviation in case.truth.deviations},
        "inherent": list(case.inherent),
        "truth_seed": case.truth.seed,
        "slow_share": case.truth.slow_share,
        "sha256": {name: digest((published / name).read_bytes()) for name in (STATION_FILE, RECORDING_FILE)},
    }
    text = labels_text(labels, secrets.token_hex(16))
    with whole_file(sealed) as file:
        file.write(text)
    with whole_file(published / SEAL_FILE) as file:
        file.write(digest(text).encode() + b"\n")


def open_case(name: str, folder: Path) -> Label:
    """Labels of a case, once seal and published files are found to be what they were.

    Raises
    ------
    RecordingError
        If one has been changed or is missing.
    """
    published, sealed = folder / "published" / name, folder / "sealed" / f"{name}.json"
    try:
        labels = opened(sealed.read_bytes(), (published / SEAL_FILE).read_text(encoding="ascii"))
        changed = [part for part, was in labels["sha256"].items() if digest((published / part).read_bytes()) != was]
    except OSError as error:
        raise RecordingError(f"{error.filename}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise RecordingError(f"{sealed}: {error}") from error
    if changed:
        raise RecordingError(f"{published / changed[0]}: is not what was sealed: its SHA-256 differs")
    return Label(
        case=labels["case"],
        kind=labels["kind"],
        plant=labels["plant"],
        names=tuple(labels["names"]),
        components=tuple(labels["components"]),
        parameters=labels["parameters"],
        inherent=tuple(labels["inherent"]),
    )


def score_trial(plan: TrialPlan, folder: Path, failed: Mapping[str, Failure]) -> dict[str, Any]:
    """Open all seals but those of the cases that failed, score the reports, write `trial.json` and `trial.html`."""
    names = [name for number in range(plan.count) if (name := f"case-{number:04}") not in failed]
    pairs = [(open_case(name, folder), _answer(folder / REPORTS / name)) for name in names]
    scores = [score_case(label, answer, _answer(folder / WHOLE_LIBRARY / label.case)) for label, answer in pairs]
    missed = [score for score in scores if score.told == "none" or score.top_2 is False]
    unfound = {score.label.case: _hidden_names(plan, folder, score) for score in missed}
    hidden = {case: effects for case, effects in unfound.items() if effects}
    rows, columns, counts = confusion(scores)
    controls: dict[str, Any] = {
        "permuted_labels": chance_level(pairs, np.random.default_rng(plan.seed)),
    }
    if plan.has_recalibration:
        again = [
            score_case(label, _answer(folder / RECALIBRATED / label.case))
            for label, _ in pairs
            if label.kind in {"single", "pair"}
        ]
        controls["recalibration_only"] = summary(again)
    result = plan.header | {
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "count": plan.count,
        "failed": [{"case": name, "error": failed[name].error} for name in sorted(failed)],
        "all": summary(scores),
        "kinds_scored": _grouped(scores, lambda score: score.label.kind),
        "hidden": hidden,
        "kinds_scored_without_hidden": _grouped(
            [score for score in scores if score.label.case not in hidden], lambda score: score.label.kind
        ),
        "named_shrinkage": named_shrinkage(scores),
        "plants_scored": _grouped(scores, lambda score: score.label.plant),
        "effects_scored": _grouped(
            [score for score in scores if score.label.kind == "single"], lambda score: score.label.names[0]
        ),
        "unseen": held_out_summary([folder / REPORTS / name for name in names]),
        "controls": controls,
        "confusion": {"rows": rows, "columns": columns, "counts": counts.tolist()},
    }
    cases = [asdict(score) for score in scores]
    _write_json(folder / "trial.json", result | {"cases": cases})
    with whole_file(folder / "trial.html") as file:
        file.write(trial_page(result, cases).encode())
    return result


def brief(result: dict[str, Any], folder: Path) -> dict[str, object]:
    """What is printed for people: right answers of how many, by kind."""
    names = ("verdict_right", "top_1", "top_2", "component_right", "false_attribution")
    rows = [
        {"kind": kind, "cases": scores["cases"]}
        | {name: f"{scores[name]['value']:.2f}" if scores[name] else "-" for name in names}
        for kind, scores in (result["kinds_scored"] | {"all": result["all"]}).items()
    ]
    return {
        "page": str(folder / "trial.html"),
        "without an answer": result["all"]["failed"],
        "failed": result["failed"],
        "scores": rows,
    }


def _grouped(scores: Sequence[CaseScore], key: Callable[[CaseScore], str]) -> dict[str, Any]:
    groups = sorted({key(score) for score in scores})
    return {group: summary([score for score in scores if key(score) == group]) for group in groups}


def _hidden_names(plan: TrialPlan, folder: Path, score: CaseScore) -> list[str]:
    case = plan.case(int(score.label.case.removeprefix("case-")))
    return hidden_names(case, folder / "published" / case.name / RECORDING_FILE, score.told_names)


def _told_effect(reports: Path) -> bool:
    answer = _answer(reports)
    return answer is not None and answer.verdict == "effect"


def _diagnose(plan: TrialPlan, folder: Path, job: Job) -> None:
    """Diagnose a case in a process that is given copies of its two published files and nothing else."""
    case, which = job
    reports = folder / which / case.name
    published = folder / "published" / case.name
    options = [part for name in case.without for part in ("--without", name) if which == REPORTS]
    if which == RECALIBRATED:
        options += [part for name in RECALIBRATION for part in ("--only", name)]
    with tempfile.TemporaryDirectory(prefix="trial-") as room:
        given, out = Path(room), Path(room) / "out"
        for name in (STATION_FILE, RECORDING_FILE):
            shutil.copy(published / name, given / name)
        arguments = ["--station", STATION_FILE, "--recording", RECORDING_FILE, "--out", out.name, *options]
        try:
            with let_interrupts():
                done = subprocess.run(  # noqa: S603 - the command is the user's own
                    [*plan.command, *arguments],
                    cwd=given,
                    stdin=subprocess.DEVNULL,
                    capture_output=True,
                    text=True,
                    timeout=plan.timeout_s,
                    check=False,
                )
            failure = "" if done.returncode == 0 else f"exit code {done.returncode}: {done.stderr.strip()[-2000:]}"
        except subprocess.TimeoutExpired:
            failure = f"no answer within {plan.timeout_s:g} s"
        except OSError as error:
            raise ConfigError(f"{plan.command[0]}: cannot be run: {error.strerror}") from error
        shutil.rmtree(reports, ignore_errors=True)
        if out.is_dir():
            shutil.copytree(out, reports)
        reports.mkdir(parents=True, exist_ok=True)
        if not failure and not (reports / REPORT_FILE).is_file():
            failure = f"wrote no {REPORT_FILE}"
        if failure:
            (reports / REPORT_FILE).unlink(missing_ok=True)
            (reports / "failure.txt").write_text(failure + "\n", encoding="utf-8")


def _answer(reports: Path) -> Answer | None:
    """Answer in a folder of reports; None, with the reason in `failure.txt`, where there is none."""
    try:
        return answer_of(json.loads((reports / REPORT_FILE).read_bytes()))
    except FileNotFoundError:
        return None
    except ValidationError as error:
        reason = first_fault(error)
    except ValueError as error:
        reason = f"is not JSON: {error}"
    (reports / "failure.txt").write_text(f"{REPORT_FILE}: {reason}\n", encoding="utf-8")
    return None


def _take_folder(plan: TrialPlan, folder: Path) -> None:
    """Make the folder of a trial, or find that it holds the same one."""
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
    _write_json(path, plan.header)


def _write_json(path: Path, value: Any) -> None:
    with whole_file(path) as file:
        file.write(json.dumps(value, indent=1).encode() + b"\n")
