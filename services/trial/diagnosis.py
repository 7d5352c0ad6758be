"""Diagnoses of a trial: processes that see two files of a case, and what they answered."""

import json
import shutil
import subprocess
import tempfile
from pathlib import Path

from pydantic import ValidationError

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.services.batch.executors import let_interrupts
from wetwell.services.trial.plan import TrialPlan
from wetwell.services.trial.sealed_case import RECORDING_FILE, STATION_FILE, published_in
from wetwell.sim2real.trial.answer import Answer, answer_of
from wetwell.sim2real.trial.cases import TrialCase

RECALIBRATION = ("friction_bias", "static_head_bias", "head_sensor_offset", "flow_meter_gain")
"""What anybody would calibrate: the library of the lower bound."""
REPORTS, RECALIBRATED, WHOLE_LIBRARY = "reports", "recalibrated", "whole_library"
"""Folders of diagnoses: as asked, by recalibration only, and of a case with a name left out with nothing left out."""
REPORT_FILE = "report.json"

Job = tuple[TrialCase, str]
"""A case, and the folder of the diagnosis that is meant."""


def is_diagnosed(job: Job, folder: Path) -> bool:
    """Whether the folder of a trial holds the report of a diagnosis."""
    case, which = job
    return (folder / which / case.name / REPORT_FILE).is_file()


def diagnose(plan: TrialPlan, folder: Path, job: Job) -> None:
    """Diagnose a case in a process that is given copies of its two published files and nothing else."""
    case, which = job
    reports = folder / which / case.name
    published = published_in(folder, case.name)
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


def answer_in(reports: Path) -> Answer | None:
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
