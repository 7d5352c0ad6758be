"""What is at fault, how far it has gone and what waiting costs: one line of the overview for each station."""

from collections.abc import Iterable, Mapping
from typing import Any

from wetwell.detector.verdict.stage import STAGES
from wetwell.protocols.messages.verdict import AssetFault, Severity, State, Verdict

FAULTS = ("sensor_fault", "system_fault", "pump_fault", "pump_and_system_fault")
"""States that name a fault, the gravest last."""
_WITHOUT_MAIN: dict[State, State] = {"system_fault": "normal", "pump_and_system_fault": "pump_fault"}
_STATE_OF = {"pump": "pump_fault", "main": "system_fault", "sensor": "sensor_fault"}

Cause = dict[str, Any]


def worst_cause(verdicts: Iterable[Verdict]) -> Cause | None:
    """Cause that asks for attention first among the last verdicts on each pump; None if none names a fault.

    The stage goes before the state, and the cost of waiting decides between equals. A verdict without a stage, of an
    earlier detector, counts as one to act on.

    Examples
    --------
    >>> told = Verdict(time=0, station="alpha", pump=2, state="pump_fault", probability={"pump_fault": 1.0},
    ...     evidence={"cost": {"cheapest": "wait", "expected": {"wait": 30.0}}}, onset=0, window=(0, 0))
    >>> cause = worst_cause([told])
    >>> cause["asset"], cause["stage"], cause["waiting_cost"]
    ('pump:2', None, 30.0)
    """
    newest = {cause["asset"]: cause for causes in standing_causes(verdicts).values() for cause in causes}
    return max(newest.values(), key=_weight, default=None)


def standing_causes(verdicts: Iterable[Verdict]) -> dict[int, list[Cause]]:
    """What is at fault by the last verdict on each pump, but for what the newest one on that asset does not tell.

    The pump that was judged last comes last.

    Examples
    --------
    >>> rest = {"station": "alpha", "probability": {}, "evidence": {}, "window": (0, 0)}
    >>> clogged = Verdict(time=1, pump=1, state="system_fault", **rest)
    >>> flushed = Verdict(time=2, pump=2, state="normal", **rest)
    >>> [cause["asset"] for cause in standing_causes([clogged])[1]], standing_causes([clogged, flushed])
    (['main'], {1: [], 2: []})
    """
    told = sorted((one for one in verdicts if one.standing() is not None), key=lambda verdict: verdict.time)
    causes = {verdict.pump: causes_of(verdict) for verdict in told}

    def stands(asset: str) -> bool:
        newest = [verdict.pump for verdict in told if verdict.speaks_of(asset)][-1:]
        return not newest or any(cause["asset"] == asset for cause in causes[newest[0]])

    return {pump: [cause for cause in own if stands(cause["asset"])] for pump, own in causes.items()}


def states_of(verdicts: Iterable[Verdict]) -> Mapping[int, State]:
    """State of each pump, without a fault of its main that stands no more."""
    verdicts = list(verdicts)
    standing = standing_causes(verdicts)

    def has(verdict: Verdict, causes: Iterable[Cause]) -> bool:
        return any(cause["asset"] == verdict.main for cause in causes)

    return {
        verdict.pump: _WITHOUT_MAIN.get(verdict.state, verdict.state)
        if has(verdict, causes_of(verdict)) and not has(verdict, standing.get(verdict.pump, ()))
        else verdict.state
        for verdict in verdicts
    }


def causes_of(verdict: Verdict) -> list[Cause]:
    """What a verdict says is at fault, the worst first."""
    waiting_cost = verdict.evidence.get("cost", {}).get("expected", {}).get("wait")
    if verdict.faults:
        return [_of_fault(fault) | {"waiting_cost": waiting_cost} for fault in verdict.faults]
    if verdict.state not in FAULTS:
        return []
    return [
        {
            "state": verdict.state,
            "asset": verdict.asset or _asset_of(verdict),
            "stage": verdict.stage,
            "waiting_cost": waiting_cost,
            **_told(verdict.onset if verdict.onset is not None else verdict.time, verdict),
        }
    ]


def _of_fault(fault: AssetFault) -> Cause:
    state = _STATE_OF.get(fault.asset.partition(":")[0], "unknown")
    return {"state": state, "asset": fault.asset, "stage": fault.stage, **_told(fault.since, fault)}


def _told(since_ns: int, source: AssetFault | Verdict) -> Cause:
    """Since when, how far and how fast."""
    severity: Severity | None = source.severity
    return {
        "since_ms": since_ns // 1_000_000,
        "severity": None if severity is None else severity.model_dump(mode="json"),
        "trend": None if source.trend is None else source.trend.model_dump(mode="json"),
    }


def _asset_of(verdict: Verdict) -> str:
    """What is at fault where the verdict names none: earlier detectors told the state alone."""
    if verdict.state == "system_fault":
        main = verdict.evidence.get("main")
        return f"main:{main}" if main else "main"
    return f"sensor:pump{verdict.pump}" if verdict.state == "sensor_fault" else f"pump:{verdict.pump}"


def _weight(cause: Cause) -> tuple[int, int, float]:
    stage = cause["stage"]
    rank = STAGES.index(stage) if stage in STAGES else len(STAGES) - 1
    state = FAULTS.index(cause["state"]) if cause["state"] in FAULTS else -1
    return rank, state, cause["waiting_cost"] or 0.0
