"""How good verdicts are, against the truth columns of a recording, which reach this file but never a detector."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Integers
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.protocols.recordings.recording import TRUTH_PREFIX, Recording
from wetwell.protocols.timestamps import LEARNING_S, NS_PER_S

CLASSES: tuple[State, ...] = ("normal", "pump_fault", "system_fault", "pump_and_system_fault", "sensor_fault")
FAULTS = CLASSES[1:]
ABSTENTIONS: tuple[State, ...] = ("unknown", "learning")


@dataclass(frozen=True, slots=True)
class ScoredRun:
    """What was told of one pump run, and what was true in most of its samples.

    Attributes
    ----------
    pump : int
        From 1.
    told, truth : State
    kind : str
        Faults that acted on the station for most of the run, as `truth_fault` names them; empty where unknown.
    severity : float
        Mean share of its full strength that the fault had; NaN where unknown. [1]
    fault_probability : float
        What the verdict gave to all faults together; NaN where it weighed none. [1]
    """

    pump: int
    told: State
    truth: State
    kind: str = ""
    severity: float = np.nan
    fault_probability: float = np.nan


def without_truth(recording: Recording) -> Recording:
    """The recording as a detector may see it."""
    columns = {name: values for name, values in recording.columns.items() if not name.startswith(TRUTH_PREFIX)}
    return replace(recording, columns=columns, truth={})


def in_order_of_time(recording: Recording) -> Recording:
    """The recording with its rows sorted by time, as windows are looked up in it."""
    if np.all(np.diff(recording.time_ns) >= 0):
        return recording
    order = np.argsort(recording.time_ns, kind="stable")
    return replace(
        recording,
        time_ns=recording.time_ns[order],
        columns={name: values[order] for name, values in recording.columns.items()},
        truth={name: values[order] for name, values in recording.truth.items()},
    )


def scored_runs(verdicts: Iterable[Verdict], recording: Recording, learning_s: float = LEARNING_S) -> list[ScoredRun]:
    """Verdicts at the end of a run beside the truth, in order of time.

    Early ones are left out, and so is what ends in the first `learning_s`; `learning` after that counts, as an
    abstention. Of several verdicts on the same run of a pump the last one counts.
    """
    from_ns = learning_end_ns(recording, learning_s)
    last = {(verdict.pump, verdict.window[0]): verdict for verdict in verdicts if not _is_early(verdict)}
    return [_scored(verdict, recording) for verdict in last.values() if verdict.window[1] > from_ns]


def learning_end_ns(recording: Recording, learning_s: float) -> int:
    """Time up to which nothing is scored."""
    return int(recording.time_ns[0]) + round(learning_s * NS_PER_S) if len(recording) else 0


def step_s(recording: Recording) -> float:
    """Time that one row stands for: the median step; 1 s with fewer than two rows. [s]."""
    return float(np.median(np.diff(recording.time_ns))) / NS_PER_S if len(recording) > 1 else 1.0


def truth_of(verdict: Verdict, recording: Recording) -> npt.NDArray[np.str_]:
    """True states of the pump in the window of a verdict."""
    states: npt.NDArray[np.str_] = recording.truth[f"truth_pump{verdict.pump}_state"][_rows(verdict, recording)]
    return states


def _rows(verdict: Verdict, recording: Recording) -> slice:
    first, after = np.searchsorted(recording.time_ns, [verdict.window[0], verdict.window[1] + 1])
    return slice(int(first), int(after))


def _is_early(verdict: Verdict) -> bool:
    return bool(verdict.evidence.get("early", False))


def _scored(verdict: Verdict, recording: Recording) -> ScoredRun:
    states = truth_of(verdict, recording)
    truth = max(CLASSES, key=lambda state: int(np.sum(states == state)))
    kind, severity = "", np.nan
    if truth != "normal":
        rows = _rows(verdict, recording)
        acting = recording.truth.get("truth_fault", np.array([], dtype=np.str_))[rows][states == truth]
        names, counts = np.unique(acting.astype(np.str_), return_counts=True)
        kind = str(names[np.argmax(counts)]) if names.size else ""
        shares = recording.truth.get(severity_column(truth, verdict.pump))
        severity = float(np.mean(shares[rows])) if shares is not None else np.nan
    return ScoredRun(verdict.pump, verdict.state, truth, kind, severity, _fault_probability(verdict))


def severity_column(state: State, pump: int) -> str:
    """Truth column that says how far a fault has grown; that of a pump has its own."""
    return f"truth_pump{pump}_severity" if state == "pump_fault" else "truth_severity"


def _fault_probability(verdict: Verdict) -> float:
    if not verdict.probability.keys() & set(CLASSES):
        return np.nan
    return min(sum(verdict.probability.get(state, 0.0) for state in FAULTS), 1.0)


def confusion(runs: Sequence[ScoredRun]) -> Integers:
    """(5, 7) number of runs by true class (`CLASSES`) and told state (`CLASSES`, then `ABSTENTIONS`)."""
    told = (*CLASSES, *ABSTENTIONS)
    table = np.zeros((len(CLASSES), len(told)), dtype=np.int64)
    for run in runs:
        table[CLASSES.index(run.truth), told.index(run.told)] += 1
    return table


def precision_and_recall(runs: Sequence[ScoredRun], state: State) -> tuple[float, float]:
    """Share of the runs told to be in a state that were, and of the runs in it that were told; 0 where there is none.

    A run of which the verdict is `unknown` or `learning` counts against recall, not against precision.
    """
    hits = sum(run.told == run.truth == state for run in runs)
    told = sum(run.told == state for run in runs)
    true = sum(run.truth == state for run in runs)
    return (hits / told if told else 0.0), (hits / true if true else 0.0)


def f1(runs: Sequence[ScoredRun], state: State) -> float:
    r"""$F_1 = 2 p r / (p + r)$ of one state, with precision p and recall r. Range 0..1; best 1."""
    precision, recall = precision_and_recall(runs, state)
    return 2.0 * precision * recall / (precision + recall) if precision + recall else 0.0


def macro_f1(runs: Sequence[ScoredRun]) -> float:
    r"""Mean of $F_1$ over the true states.

    Range 0..1; best 1. States that no run was truly in do not count by themselves.

    Examples
    --------
    >>> runs = [ScoredRun(1, "normal", "normal"), ScoredRun(1, "normal", "pump_fault")]
    >>> round(macro_f1(runs), 3)
    0.333
    """
    scores = [f1(runs, state) for state in sorted({run.truth for run in runs})]
    return sum(scores) / len(scores) if scores else 0.0
