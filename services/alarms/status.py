"""The status of an alarm: the states of ISA-18.2 and the ways between them. Pure; the clock is an argument."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from wetwell.protocols.messages.alarm import AlarmAct, AlarmState

NS_PER_MIN = 60 * 1_000_000_000
SUPPRESSED: frozenset[AlarmState] = frozenset({"shelved", "suppressed", "out_of_service"})
"""States in which the condition is still followed, but nobody is called."""


_SEEN: Mapping[AlarmState, AlarmState] = {
    "unacknowledged": "acknowledged",
    "returned": "normal",
    "latched_unacknowledged": "latched_acknowledged",
}
"""What an acknowledgement makes of a state."""


class ActRefusedError(ValueError):
    """An act that the state of the alarm does not allow; says why."""


@dataclass(frozen=True)
class AlarmStatus:
    """State of one alarm. A standing alarm is active; one that has returned may still wait for its acknowledgement.

    `raised_ns`, `returned_ns` and `acknowledged_ns` are those of the last time and in the time of the station,
    `until_ns` (end of the shelf) is on the wall clock; `by` and `reason` belong to the last act.
    """

    state: AlarmState = "normal"
    is_active: bool = False
    raised_ns: int | None = None
    returned_ns: int | None = None
    acknowledged_ns: int | None = None
    by: str | None = None
    until_ns: int | None = None
    reason: str = ""


def with_condition(
    status: AlarmStatus, *, is_active: bool, time_ns: int, is_call: bool = True, is_latching: bool = False
) -> AlarmStatus:
    """Status after the condition has come or gone; the same if it has not changed.

    Parameters
    ----------
    status : AlarmStatus
    is_active : bool
        Whether the condition is there.
    time_ns : int
        Of the station.
    is_call : bool
        Whether somebody is called; else it is as if it had been acknowledged.
    is_latching : bool
        Whether the alarm stays until somebody resets it.
    """
    if is_active == status.is_active:
        return status
    if status.state in SUPPRESSED:
        changed = {"raised_ns": time_ns, "returned_ns": None} if is_active else {"returned_ns": time_ns}
        return replace(status, is_active=is_active, **changed)
    if is_active:
        return AlarmStatus("unacknowledged" if is_call else "acknowledged", is_active=True, raised_ns=time_ns)
    is_seen = status.state != "unacknowledged"
    state: AlarmState = "normal" if is_seen else "returned"
    if is_latching:
        state = "latched_acknowledged" if is_seen else "latched_unacknowledged"
    return replace(status, state=state, is_active=False, returned_ns=time_ns)


def with_act(status: AlarmStatus, act: AlarmAct, now_ns: int, time_ns: int) -> AlarmStatus:
    """Status after an act of an operator at this time of day, and of the station.

    Raises
    ------
    ActRefusedError
        If the state does not allow it.
    """
    state = status.state
    match act.act:
        case "acknowledge" if state in _SEEN:
            return replace(status, state=_SEEN[state], acknowledged_ns=time_ns, by=act.by, reason=act.reason)
        case "reset" if state == "latched_acknowledged":
            return replace(status, state="normal", by=act.by, reason=act.reason)
        case "shelve" if state not in ("suppressed", "out_of_service") and act.minutes is not None:
            until_ns = now_ns + round(act.minutes * NS_PER_MIN)
            return replace(status, state="shelved", until_ns=until_ns, by=act.by, reason=act.reason)
        case "out_of_service" if state != "out_of_service":
            return replace(status, state="out_of_service", until_ns=None, by=act.by, reason=act.reason)
        case "unshelve" if state == "shelved":
            return back(status, act.by, act.reason)
        case "in_service" if state == "out_of_service":
            return back(status, act.by, act.reason)
    raise ActRefusedError(f"{act.act}: the alarm is {state}")


def back(status: AlarmStatus, by: str, reason: str = "") -> AlarmStatus:
    """Status after a suppression: the operator is called anew if the condition is there."""
    state: AlarmState = "unacknowledged" if status.is_active else "normal"
    return replace(status, state=state, acknowledged_ns=None, by=by, until_ns=None, reason=reason)


def by_design(status: AlarmStatus) -> AlarmStatus:
    """Status while the mode of the station suppresses the alarm; shelf and workshop go before."""
    return status if status.state in SUPPRESSED else replace(status, state="suppressed")


def escalated(status: AlarmStatus) -> AlarmStatus:
    """Status of an alarm that has become more urgent: who has acknowledged it is called again."""
    return replace(status, state="unacknowledged") if status.state == "acknowledged" else status


def is_shelf_over(status: AlarmStatus, now_ns: int) -> bool:
    """Whether the alarm is on a shelf whose end has come."""
    return status.state == "shelved" and status.until_ns is not None and now_ns >= status.until_ns
