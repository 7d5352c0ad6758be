"""The result of a trial: seals opened, answers scored, `trial.json` and `trial.html` written."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from wetwell.protocols.atomic_file import atomic_file
from wetwell.services.batch.parallel import Failure
from wetwell.services.trial.diagnosis import RECALIBRATED, REPORTS, WHOLE_LIBRARY, answer_in
from wetwell.services.trial.holdout import holdout_summary
from wetwell.services.trial.page import trial_page
from wetwell.services.trial.plan import TrialPlan
from wetwell.services.trial.sealed_case import open_case
from wetwell.sim2real.trial.cases import KNOWN_KINDS
from wetwell.sim2real.trial.reliability import reliability
from wetwell.sim2real.trial.scores import CaseScore, chance_level, confusion, named_shrinkage, score_case, summary


def score_trial(plan: TrialPlan, folder: Path, failed: Mapping[str, Failure]) -> dict[str, Any]:
    """Open all seals but those of the cases that failed, score the reports, write `trial.json` and `trial.html`."""
    names = [name for number in range(plan.count) if (name := plan.case(number).name) not in failed]
    pairs = [(open_case(name, folder), answer_in(folder / REPORTS / name)) for name in names]
    scores = [score_case(label, answer, answer_in(folder / WHOLE_LIBRARY / label.case)) for label, answer in pairs]
    controls: dict[str, Any] = {
        "permuted_labels": chance_level(pairs, np.random.default_rng(plan.seed)),
    }
    if plan.has_recalibration:
        again = [
            score_case(label, answer_in(folder / RECALIBRATED / label.case))
            for label, _ in pairs
            if label.kind in KNOWN_KINDS
        ]
        controls["recalibration_only"] = summary(again)
    result = plan.header | {
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "count": plan.count,
        "failed": [{"case": name, "error": failed[name].error} for name in sorted(failed)],
        "all": summary(scores),
        "kinds_scored": _grouped(scores, lambda score: score.label.kind),
        "reliability": {
            "all": _reliability(scores),
            **{group: _reliability(ours) for group, ours in _groups(scores, lambda score: score.label.plant).items()},
            **{
                group: _reliability(ours)
                for group, ours in _groups(scores, lambda score: score.label.metering).items()
            },
        },
        "named_shrinkage": named_shrinkage(scores),
        "plants_scored": _grouped(scores, lambda score: score.label.plant),
        "effects_scored": _grouped(
            [score for score in scores if score.label.kind == "single"], lambda score: score.label.names[0]
        ),
        "splits": {
            "rate": _split(scores, lambda score: score.label.rate),
            "inflow": _split(scores, lambda score: score.label.metering),
            "noise": _split(scores, lambda score: score.label.noise),
            "pumps": _split(scores, lambda score: score.label.pumps),
        },
        "unseen": holdout_summary([folder / REPORTS / name for name in names]),
        "controls": controls,
        "confusion": _confusion(scores),
    }
    cases = [asdict(score) for score in scores]
    with atomic_file(folder / "trial.json") as file:
        file.write(json.dumps(result | {"cases": cases}, indent=1).encode() + b"\n")
    with atomic_file(folder / "trial.html") as file:
        file.write(trial_page(result, cases).encode())
    return result


def brief(result: dict[str, Any], folder: Path) -> dict[str, object]:
    """What is printed for people: right answers of how many, by kind, rate, metering and noise."""
    names = ("verdict_right", "exact_set", "exact_by_name", "top_1", "top_2", "component_right", "false_attribution")
    split = {group: parts["scores"] for groups in result["splits"].values() for group, parts in groups.items()}
    rows = [
        {"kind": kind, "cases": scores["cases"], "not_tested": scores["not_tested"]}
        | {name: f"{scores[name]['value']:.2f}" if scores[name] else "-" for name in names}
        for kind, scores in (result["kinds_scored"] | split | {"all": result["all"]}).items()
    ]
    return {
        "page": str(folder / "trial.html"),
        "without an answer": result["all"]["failed"],
        "failed": result["failed"],
        "calibration error": (result["reliability"]["all"] or {}).get("calibration_error"),
        "scores": rows,
    }


def _confusion(scores: Sequence[CaseScore]) -> dict[str, Any]:
    rows, columns, counts = confusion(scores)
    return {"rows": rows, "columns": columns, "counts": counts.tolist()}


def _split(scores: Sequence[CaseScore], key: Callable[[CaseScore], str]) -> dict[str, Any]:
    """Scores and confusion of each group."""
    groups = dict.fromkeys(key(score) for score in sorted(scores, key=lambda score: score.label.every_s))
    of_group = {group: [score for score in scores if key(score) == group] for group in groups}
    return {group: {"scores": summary(ours), "confusion": _confusion(ours)} for group, ours in of_group.items()}


def _grouped(scores: Sequence[CaseScore], key: Callable[[CaseScore], str]) -> dict[str, Any]:
    return {group: summary(ours) for group, ours in _groups(scores, key).items()}


def _groups(scores: Sequence[CaseScore], key: Callable[[CaseScore], str]) -> dict[str, list[CaseScore]]:
    return {group: [one for one in scores if key(one) == group] for group in sorted({key(one) for one in scores})}


def _reliability(scores: Sequence[CaseScore]) -> dict[str, Any] | None:
    return reliability([score.said for score in scores if score.said is not None])
