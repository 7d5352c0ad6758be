"""How good verdicts are, against the truth columns of a recording, which reach this file but never the detector."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from wetwell.detector.posterior import FAULTS, STATES
from wetwell.protocols.messages import State, Verdict
from wetwell.protocols.recording import Recording
from wetwell.protocols.stamps import NS_PER_S

DAY_S = 86_400.0


@dataclass(frozen=True, slots=True)
class ScoredRun:
    """What was told of one pump run, and what was true in most of its samples."""

    pump: int
    told: State
    truth: State


@dataclass(frozen=True, slots=True)
class FalseAlarms:
    """Alarms while nothing was wrong, and how long nothing was wrong, in station-days under watch."""

    count: int
    station_days: float


def scored_runs(verdicts: Iterable[Verdict], recording: Recording) -> list[ScoredRun]:
    """Verdicts at the end of a run beside the truth; early ones and those of the learning phase are left out."""
    return [
        ScoredRun(verdict.pump, verdict.state, _majority(_truth_of(verdict, recording)))
        for verdict in verdicts
        if verdict.state != "learning" and not verdict.evidence.get("early", False)
    ]


def _truth_of(verdict: Verdict, recording: Recording) -> npt.NDArray[np.str_]:
    """True states of the pump in the window of a verdict."""
    first, last = np.searchsorted(recording.time_ns, verdict.window)
    states: npt.NDArray[np.str_] = recording.truth[f"truth_pump{verdict.pump}_state"][first : last + 1]
    return states


def _majority(states: npt.NDArray[np.str_]) -> State:
    return max(STATES, key=lambda state: int(np.sum(states == state)))


def precision_and_recall(runs: Sequence[ScoredRun], state: State) -> tuple[float, float]:
    """Share of the runs told to be in a state that were, and of the runs in it that were told; 0 where there is none.

    A run of which the verdict is `unknown` counts against recall, not against precision.
    """
    hits = sum(run.told == run.truth == state for run in runs)
    told = sum(run.told == state for run in runs)
    true = sum(run.truth == state for run in runs)
    return (hits / told if told else 0.0), (hits / true if true else 0.0)


def macro_f1(runs: Sequence[ScoredRun]) -> float:
    r"""Mean over the true states of $F_1 = 2 p r / (p + r)$ with precision p and recall r.

    Range 0..1; best 1. States that no run was truly in do not count by themselves.

    Examples
    --------
    >>> runs = [ScoredRun(1, "normal", "normal"), ScoredRun(1, "normal", "pump_fault")]
    >>> round(macro_f1(runs), 3)
    0.333
    """
    scores = []
    for state in {run.truth for run in runs}:
        precision, recall = precision_and_recall(runs, state)
        scores.append(2.0 * precision * recall / (precision + recall) if precision + recall else 0.0)
    return sum(scores) / len(scores) if scores else 0.0


def false_alarms(verdicts: Iterable[Verdict], recording: Recording) -> FalseAlarms:
    """Faults told of windows without any fault; several in a row on one pump are one alarm.

    Time counts, pump by pump, while the pump is healthy and its learning is over, and is divided by the pumps.
    """
    watched_from_ns: dict[int, int] = {}
    is_false: dict[int, bool] = {}
    count = 0
    for verdict in verdicts:
        if verdict.state == "learning":
            continue
        watched_from_ns.setdefault(verdict.pump, verdict.time)
        was_false = is_false.get(verdict.pump, False)
        is_false[verdict.pump] = verdict.state in FAULTS and bool(np.all(_truth_of(verdict, recording) == "normal"))
        count += is_false[verdict.pump] and not was_false
    healthy_s = sum(
        int(np.sum((recording.truth[f"truth_pump{pump}_state"] == "normal") & (recording.time_ns >= from_ns)))
        for pump, from_ns in watched_from_ns.items()
    )
    return FalseAlarms(count, healthy_s / DAY_S / max(recording.pumps, 1))


def poisson_interval(count: int, exposure: float, confidence: float = 0.95) -> tuple[float, float]:
    """Exact interval of the rate of events of which `count` were seen in `exposure` (> 0).

    References
    ----------
    .. [1] F. Garwood, Fiducial limits for the Poisson distribution, Biometrika 28, 1936.

    Examples
    --------
    >>> low, high = poisson_interval(0, 10.0)
    >>> low, round(high, 3)
    (0.0, 0.369)
    """
    tail = (1.0 - confidence) / 2.0
    low = float(chi2.ppf(tail, 2 * count)) / 2.0 if count else 0.0
    return low / exposure, float(chi2.isf(tail, 2 * count + 2)) / 2.0 / exposure


def detection_delay_s(verdicts: Iterable[Verdict], recording: Recording, state: State) -> float | None:
    """Time from the first second of a true state until a verdict tells it of a pump that is in it; None if none does.

    `pump_and_system_fault` tells of both. [s].
    """
    pumps = range(1, recording.pumps + 1)
    starts_ns = {
        pump: int(recording.time_ns[np.argmax(is_true)])
        for pump in pumps
        if (is_true := recording.truth[f"truth_pump{pump}_state"] == state).any()
    }
    for verdict in verdicts:
        is_told = verdict.state in (state, "pump_and_system_fault")
        if is_told and verdict.pump in starts_ns and verdict.time >= starts_ns[verdict.pump]:
            return (verdict.time - starts_ns[verdict.pump]) / NS_PER_S
    return None
