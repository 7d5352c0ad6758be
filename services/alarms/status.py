"""The status of an alarm: the states of ISA-18.2 and the ways between them. Pure; the clock is an argument."""

from dataclasses import dataclass, replace

from wetwell.protocols.messages.alarm import AlarmAct, AlarmState

NS_PER_MIN = 60 * 1_000_000_000
SUPPRESSED: frozenset[AlarmState] = frozenset({"shelved", "out_of_service"})
"""States in which the condition is still followed, but nobody is called."""


class ActRefusedError(ValueError):
    """An act that the state of the alarm does not allow; says why."""


@dataclass(frozen=True)
class AlarmStatus:
    """State of one alarm. A standing alarm is active; one that has returned may still wait for its acknowledgement.

    `raised_ns` and `returned_ns` are those of the last time and in the time of the station, `acknowledged_ns` and
    `until_ns` (end of the shelf) on the wall clock; `by` and `reason` belong to the last act.
    """

    state: AlarmState = "normal"
    is_active: bool = False
    raised_ns: int | None = None
    returned_ns: int | None = None
    acknowledged_ns: int | None = None
    by: str | None = None
    until_ns: int | None = None
    reason: str = ""


def with_condition(status: AlarmStatus, *, is_active: bool, time_ns: int) -> AlarmStatus:
    """Status after the condition has come or gone; the same if it has not changed."""
    if is_active == status.is_active:
        return status
    if status.state in SUPPRESSED:
        changed = {"raised_ns": time_ns, "returned_ns": None} if is_active else {"returned_ns": time_ns}
        return replace(status, is_active=is_active, **changed)
    if is_active:
        return AlarmStatus("unacknowledged", is_active=True, raised_ns=time_ns)
    state: AlarmState = "returned" if status.state == "unacknowledged" else "normal"
    return replace(status, state=state, is_active=False, returned_ns=time_ns)


def with_act(status: AlarmStatus, act: AlarmAct, now_ns: int) -> AlarmStatus:
    """Status after an act of an operator at this time of day.

    Raises
    ------
    ActRefusedError
        If the state does not allow it.
    """
    state = status.state
    match act.act:
        case "acknowledge" if state in ("unacknowledged", "returned"):
            after: AlarmState = "acknowledged" if state == "unacknowledged" else "normal"
            return replace(status, state=after, acknowledged_ns=now_ns, by=act.by, reason=act.reason)
        case "shelve" if state != "out_of_service" and act.minutes is not None:
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


def is_shelf_over(status: AlarmStatus, now_ns: int) -> bool:
    """Whether the alarm is on a shelf whose end has come."""
    return status.state == "shelved" and status.until_ns is not None and now_ns >= status.until_ns
