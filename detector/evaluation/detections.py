"""False alarms, and how soon a fault is told, against the truth columns of a recording."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from wetwell.detector.baseline.learning import DAY_S
from wetwell.detector.evaluation.scores import FAULTS, learning_end_ns, severity_column, step_s, truth_of
from wetwell.detector.stream.run_state import WARM_UP_S
from wetwell.protocols.arrays import Flags
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import LEARNING_S, NS_PER_S

MERGE_S = 3600.0
"""A fault that comes again within this time is the same fault. [s]"""
ORIGINS: tuple[State, ...] = ("pump_fault", "system_fault", "sensor_fault")
_BOTH: State = "pump_and_system_fault"


@dataclass(frozen=True, slots=True)
class FalseAlarms:
    """Alarms while nothing was wrong, and how long nothing was wrong, in station-days under watch."""

    count: int
    station_days: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """A fault that began after learning, and how it was told.

    Attributes
    ----------
    state : State
        `pump_fault`, `system_fault` or `sensor_fault`; both at once are two of these.
    delay_s : float or None
        From its first second to the first verdict that tells it; None if none does. [s]
    steady_delay_s : float or None
        The same from the first steady sample of a pump that feels it: before, nobody can see it. [s]
    severity : float or None
        Share of its full strength at that time, if the recording says. [1]
    runs : int or None
        Pump runs that ended until then, the one that tells it included.
    """

    state: State
    delay_s: float | None
    steady_delay_s: float | None
    severity: float | None
    runs: int | None


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
        is_false[verdict.pump] = verdict.state in FAULTS and bool(np.all(truth_of(verdict, recording) == "normal"))
        count += is_false[verdict.pump] and not was_false
    healthy_rows = sum(
        int(np.sum((recording.truth[f"truth_pump{pump}_state"] == "normal") & (recording.time_ns >= from_ns)))
        for pump, from_ns in watched_from_ns.items()
    )
    return FalseAlarms(count, healthy_rows * step_s(recording) / DAY_S / max(recording.pumps, 1))


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


def detections(verdicts: Sequence[Verdict], recording: Recording, learning_s: float = LEARNING_S) -> list[Detection]:
    """Every fault that began after learning, and how it was told.

    A fault of a pump must be told of that pump, one of the rising main or of a sensor of any pump that feels it, each
    by a verdict whose window reaches into the fault. `pump_and_system_fault` tells of both.
    """
    from_ns = learning_end_ns(recording, learning_s)
    found = []
    for state in ORIGINS:
        felt = {pump: _acts(recording, pump, state) for pump in range(1, recording.pumps + 1)}
        shared = {0: np.logical_or.reduce(list(felt.values()))} if felt else {}
        for pump, acts in (felt if state == "pump_fault" else shared).items():
            for first, last in _spans(acts, recording):
                concerned = [pump] if pump else [other for other in felt if felt[other][first : last + 1].any()]
                if recording.time_ns[first] > from_ns:
                    found.append(_detection(verdicts, recording, state, concerned, (first, last)))
    return found


def _acts(recording: Recording, pump: int, state: State) -> Flags:
    states = recording.truth[f"truth_pump{pump}_state"]
    acts: Flags = states == state
    return acts if state == "sensor_fault" else acts | (states == _BOTH)


def _spans(acts: Flags, recording: Recording) -> Iterator[tuple[int, int]]:
    """First and last row of each fault."""
    rows = np.flatnonzero(acts)
    if rows.size:
        gaps = np.flatnonzero(np.diff(recording.time_ns[rows]) > MERGE_S * NS_PER_S)
        yield from zip(rows[np.append(0, gaps + 1)].tolist(), rows[np.append(gaps, -1)].tolist(), strict=True)


def _detection(
    verdicts: Sequence[Verdict], recording: Recording, state: State, pumps: Sequence[int], span: tuple[int, int]
) -> Detection:
    begin_ns, end_ns = (int(recording.time_ns[row]) for row in span)
    tells = {state} if state == "sensor_fault" else {state, _BOTH}
    runs = 0
    for verdict in verdicts:
        if verdict.pump not in pumps or verdict.window[1] < begin_ns or verdict.window[0] > end_ns:
            continue
        is_told = verdict.state in tells
        runs += is_told or not verdict.evidence.get("early", False)
        if is_told:
            row = min(int(np.searchsorted(recording.time_ns, verdict.window[1])), span[1])
            shares = recording.truth.get(severity_column(state, pumps[0]))
            steady_ns = min(_first_steady_ns(recording, pump, begin_ns) for pump in pumps)
            return Detection(
                state=state,
                delay_s=(verdict.time - begin_ns) / NS_PER_S,
                steady_delay_s=max(verdict.time - steady_ns, 0) / NS_PER_S,
                severity=None if shares is None else float(shares[row]),
                runs=runs,
            )
    return Detection(state=state, delay_s=None, steady_delay_s=None, severity=None, runs=None)


def _first_steady_ns(recording: Recording, pump: int, begin_ns: int) -> int:
    """Time from `begin_ns` on at which a pump has first run for `WARM_UP_S`; of the last sample if it never has."""
    signal = "running" if pump_column(pump, "running") in recording.columns else "frequency_hz"
    is_on = recording.column(pump_column(pump, signal)) > 0.0
    off_ns = np.maximum.accumulate(np.where(is_on, recording.time_ns[0], recording.time_ns))
    steady = is_on & (recording.time_ns - off_ns >= WARM_UP_S * NS_PER_S) & (recording.time_ns >= begin_ns)
    return int(recording.time_ns[np.argmax(steady) if steady.any() else -1])
