"""Running a trial: publish, diagnose, open the seals, score."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from wetwell.services.batch.parallel import Failure, refuse_if_all, work_through
from wetwell.services.trial.diagnosis import (
    RECALIBRATED,
    REPORTS,
    WHOLE_LIBRARY,
    Job,
    answer_in,
    diagnose,
    is_diagnosed,
)
from wetwell.services.trial.holdout import measure_holdout
from wetwell.services.trial.plan import TrialPlan, take_folder
from wetwell.services.trial.result import score_trial
from wetwell.services.trial.sealed_case import is_published, open_case, publish, published_in
from wetwell.sim2real.trial.cases import KNOWN_KINDS, TrialCase


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
    take_folder(plan, folder)
    failed: dict[str, Failure] = {}

    def each(title: str, work: Callable[[Job], None], jobs: Iterable[Job], is_done: Callable[[Job], bool]) -> None:
        sound = [job for job in jobs if job[0].name not in failed]
        left = [job for job in sound if not is_done(job)]
        done = work_through(work, left, len(left), min(workers, max(len(left), 1)), title, scheduler)
        found = {left[number][0].name: result for number, result in done if isinstance(result, Failure)}
        refuse_if_all(list(found.values()), len({case.name for case, _ in sound}))
        failed.update(found)

    cases = [plan.case(number) for number in range(plan.count)]
    deviating = [case for case in cases if case.kind in KNOWN_KINDS]
    jobs = [(case, REPORTS) for case in cases]
    each("cases", partial(_publish, folder), jobs, lambda job: is_published(job[0], folder))
    if plan.has_recalibration:
        jobs += [(case, RECALIBRATED) for case in deviating]
    diagnosis, has_report = partial(diagnose, plan, folder), partial(is_diagnosed, folder=folder)
    each("diagnoses", diagnosis, jobs, has_report)
    named = [(case, WHOLE_LIBRARY) for case in cases if case.without and _told_effect(folder / REPORTS / case.name)]
    each("equivalents", diagnosis, named, has_report)
    if plan.replay:
        published = [(_as_published(case, folder), REPORTS) for case in deviating if case.name not in failed]
        each("unseen recordings", partial(_measure_holdout, plan, folder), published, lambda _: False)
    return score_trial(plan, folder, failed)


def _as_published(case: TrialCase, folder: Path) -> TrialCase:
    """The case in the attempt that its seal tells."""
    return replace(case, attempt=open_case(case.name, folder).attempt)


def _publish(folder: Path, job: Job) -> None:
    publish(job[0], folder)


def _measure_holdout(plan: TrialPlan, folder: Path, job: Job) -> None:
    case, which = job
    measure_holdout(case, published_in(folder, case.name), folder / which / case.name, plan.replay)


def _told_effect(reports: Path) -> bool:
    answer = answer_in(reports)
    return answer is not None and answer.verdict == "effect"
