"""Figures of one detector over any number of scored recordings."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from wetwell.detector.baseline.learning import DAY_S
from wetwell.detector.evaluation.detections import (
    ORIGINS,
    Detection,
    FalseAlarms,
    detections,
    false_alarms,
    poisson_interval,
)
from wetwell.detector.evaluation.reliability import reliability
from wetwell.detector.evaluation.scores import (
    ABSTENTIONS,
    CLASSES,
    FAULTS,
    ScoredRun,
    confusion,
    f1,
    macro_f1,
    precision_and_recall,
    scored_runs,
    step_s,
)
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import LEARNING_S

SEVERITY_EDGES = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)
_LEAST = 1e-9  # a fault that has just begun belongs to the first bin


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What one detector made of one recording; `judging_s` is the time that it took, `station_days` its length."""

    runs: tuple[ScoredRun, ...]
    alarms: FalseAlarms
    detections: tuple[Detection, ...]
    station_days: float
    judging_s: float


def outcome(
    verdicts: Sequence[Verdict], recording: Recording, judging_s: float, learning_s: float = LEARNING_S
) -> Outcome:
    """Score the verdicts on a recording, whose rows are in the order of time."""
    return Outcome(
        runs=tuple(scored_runs(verdicts, recording, learning_s)),
        alarms=false_alarms(verdicts, recording),
        detections=tuple(detections(verdicts, recording, learning_s)),
        station_days=len(recording) * step_s(recording) / DAY_S,
        judging_s=judging_s,
    )


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """All figures as JSON holds them; None where there is nothing to tell."""
    runs = [run for one in outcomes for run in one.runs]
    scores = [macro_f1(one.runs) for one in outcomes if one.runs]
    days = sum(one.station_days for one in outcomes)
    return {
        "recordings": len(outcomes),
        "station_days": days,
        "runs": len(runs),
        "macro_f1": macro_f1(runs) if runs else None,
        "macro_f1_by_recording": {
            "mean": float(np.mean(scores)) if scores else None,
            "quantile_5": float(np.quantile(scores, 0.05)) if scores else None,
            "least": min(scores, default=None),
        },
        "states": {
            state: _state_figures(runs, state) for state in CLASSES if any(run.truth == state for run in runs)
        },
        "confusion": {
            "truth": list(CLASSES),
            "told": [*CLASSES, *ABSTENTIONS],
            "runs": confusion(runs).tolist(),
        },
        "abstention": {
            state: sum(run.told == state for run in runs) / len(runs) if runs else None for state in ABSTENTIONS
        },
        "false_alarms": _alarm_figures(outcomes),
        "run_length": _run_lengths(outcomes, runs),
        "detection": _detection_figures([found for one in outcomes for found in one.detections]),
        "kinds": [
            {"kind": kind, **_recall([run for run in runs if run.kind == kind])}
            for kind in sorted({run.kind for run in runs} - {""})
        ],
        "severities": _severity_figures(runs),
        "reliability": reliability(runs),
        "judging_s_per_station_day": sum(one.judging_s for one in outcomes) / days if days else None,
    }


def _state_figures(runs: Sequence[ScoredRun], state: State) -> dict[str, Any]:
    precision, recall = precision_and_recall(runs, state)
    count = sum(run.truth == state for run in runs)
    return {"runs": count, "precision": precision, "recall": recall, "f1": f1(runs, state)}


def _alarm_figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    count = sum(one.alarms.count for one in outcomes)
    days = sum(one.alarms.station_days for one in outcomes)
    return {
        "count": count,
        "station_days": days,
        "per_station_day": count / days if days else None,
        "interval_95": list(poisson_interval(count, days)) if days else None,
    }


def _run_lengths(outcomes: Sequence[Outcome], runs: Sequence[ScoredRun]) -> dict[str, Any]:
    """Pump runs until an alarm: in health until a false one (mean), in a fault until it is told (median)."""
    healthy = sum(run.truth == "normal" and run.told not in ABSTENTIONS for run in runs)
    count = sum(one.alarms.count for one in outcomes)
    fewest, most = poisson_interval(count, healthy) if healthy else (np.nan, np.nan)
    needed = [np.inf if found.runs is None else found.runs for one in outcomes for found in one.detections]
    return {
        "healthy_runs": healthy,
        "healthy": healthy / count if count else None,
        "healthy_interval_95": [1.0 / most, 1.0 / fewest if fewest else None] if healthy else None,
        "faulty_median": _quantile(needed, 0.5),
    }


def _detection_figures(found: Sequence[Detection]) -> dict[str, Any]:
    figures: dict[str, Any] = {}
    for state in ORIGINS:
        own = [one for one in found if one.state == state]
        if not own:
            continue
        delays_s = [np.inf if one.delay_s is None else one.delay_s for one in own]
        steady_s = [np.inf if one.steady_delay_s is None else one.steady_delay_s for one in own]
        severities = [one.severity for one in own if one.severity is not None]
        figures[state] = {
            "faults": len(own),
            "missed": sum(one.delay_s is None for one in own),
            "delay_s": {"median": _quantile(delays_s, 0.5), "quantile_95": _quantile(delays_s, 0.95)},
            "steady_delay_s": {"median": _quantile(steady_s, 0.5), "quantile_95": _quantile(steady_s, 0.95)},
            "severity_at_alarm": {"median": _quantile(severities, 0.5), "quantile_95": _quantile(severities, 0.95)},
        }
    return figures


def _severity_figures(runs: Sequence[ScoredRun]) -> list[dict[str, Any]]:
    rows = []
    for state in FAULTS:
        for low, high in pairwise(SEVERITY_EDGES):
            held = [run for run in runs if run.truth == state and low < max(run.severity, _LEAST) <= high]
            if held:
                rows.append({"state": state, "from": low, "to": high, **_recall(held)})
    return rows


def _recall(runs: Sequence[ScoredRun]) -> dict[str, Any]:
    """Share of faulty runs that were told rightly, and of which any fault was told."""
    return {
        "runs": len(runs),
        "recall": sum(run.told == run.truth for run in runs) / len(runs),
        "noticed": sum(run.told in FAULTS for run in runs) / len(runs),
    }


def _quantile(values: Sequence[float], share: float) -> float | None:
    """Least value that this share of the values does not exceed; None without values or where it is infinite."""
    if not len(values):
        return None
    value = float(np.quantile(np.array(values, dtype=float), share, method="inverted_cdf"))
    return value if np.isfinite(value) else None
