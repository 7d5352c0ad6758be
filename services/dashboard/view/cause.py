"""What is at fault, how far it has gone and what waiting costs: one line of the overview for each station."""

from collections.abc import Iterable
from typing import Any

from wetwell.protocols.messages.verdict import Verdict

STAGES = ("watch", "plan", "act")
FAULTS = ("sensor_fault", "system_fault", "pump_fault", "pump_and_system_fault")
"""States that name a fault, the gravest last."""
_MAIN_QUANTITY = {
    "pump_fault": "speed_loss_percent",
    "pump_and_system_fault": "speed_loss_percent",
    "system_fault": "friction_rise_percent",
}


def worst_cause(verdicts: Iterable[Verdict]) -> dict[str, Any] | None:
    """Cause that asks for attention first among the last verdicts on each pump; None if no verdict names a fault.

    The stage goes before the state, and the cost of waiting decides between equals.

    Examples
    --------
    >>> told = Verdict(time=0, station="alpha", pump=2, state="pump_fault", probability={"pump_fault": 1.0},
    ...     evidence={"cost": {"cheapest": "wait", "expected": {"wait": 30.0}}}, onset=0, window=(0, 0))
    >>> cause = worst_cause([told])
    >>> cause["asset"], cause["stage"], cause["waiting_cost"]
    ('pump:2', None, 30.0)
    """
    causes = [cause_of(verdict) for verdict in verdicts if verdict.state in FAULTS]
    return max(causes, key=_weight, default=None)


def cause_of(verdict: Verdict) -> dict[str, Any]:
    """What a verdict that names a fault says of it, as the page shows it; an earlier detector told less."""
    fields = verdict.model_dump(mode="json")
    expected = verdict.evidence.get("cost", {}).get("expected", {})
    return {
        "state": verdict.state,
        "asset": fields.get("asset") or _asset_of(verdict),
        "stage": fields.get("stage"),
        "since": fields["onset"] or fields["time"],
        "severity": fields.get("severity") or _severity_of(verdict),
        "trend": fields.get("trend"),
        "waiting_cost": expected.get("wait"),
    }


def _asset_of(verdict: Verdict) -> str:
    """What is at fault where the verdict names none: earlier detectors told the state alone."""
    if verdict.state == "system_fault":
        main = verdict.evidence.get("main")
        return f"main:{main}" if main else "main"
    return f"sensor:pump{verdict.pump}" if verdict.state == "sensor_fault" else f"pump:{verdict.pump}"


def _severity_of(verdict: Verdict) -> dict[str, Any] | None:
    quantity = _MAIN_QUANTITY.get(verdict.state, "")
    figure = verdict.evidence.get("severity", {}).get(quantity)
    return None if figure is None else {"quantity": quantity, **figure}


def _weight(cause: dict[str, Any]) -> tuple[int, int, float]:
    stage = cause["stage"]
    rank = STAGES.index(stage) if stage in STAGES else len(STAGES) - 1
    return rank, FAULTS.index(cause["state"]), cause["waiting_cost"] or 0.0
