"""Spans of time with a verdict or an alarm, from what was kept of their changes."""

from collections.abc import Iterable, Mapping
from typing import Any, get_args

from wetwell.protocols.messages.alarm import Priority

Band = dict[str, Any]

URGENCY = get_args(Priority)
"""The most urgent last."""
_OF_BAND = ("id", "pump", "text", "asset", "stage", "severity", "trend")


def verdict_bands(changes: Iterable[Mapping[str, Any]]) -> list[Band]:
    """One band for each change of state of a pump, until the next; the last one is open (`to` is None).

    Parameters
    ----------
    changes : iterable of mapping
        `time`, `pump` and `state`, and where they were told `asset` and `stage`; oldest first.

    Examples
    --------
    >>> told = [{"time": "t1", "pump": 1, "state": "normal"}, {"time": "t2", "pump": 1, "state": "unknown"}]
    >>> bands = verdict_bands(told)
    >>> [(band["state"], band["from"], band["to"]) for band in bands]
    [('normal', 't1', 't2'), ('unknown', 't2', None)]
    """
    bands: list[Band] = []
    standing: dict[int, Band] = {}
    for change in changes:
        pump = change["pump"]
        if pump in standing:
            standing[pump]["to"] = change["time"]
        named = {name: change.get(name) for name in ("pump", "state", "asset", "stage")}
        standing[pump] = named | {"from": change["time"], "to": None}
        bands.append(standing[pump])
    return bands


def alarm_bands(changes: Iterable[Mapping[str, Any]]) -> list[Band]:
    """One band for each time that the condition of an alarm was there; an open one has `to` None.

    A change tells since when its alarm is raised, so that one that was raised before the first change is whole. A
    band has the words of the last change, and the most urgent priority that its alarm has had.

    Examples
    --------
    >>> raised = {"id": "level_high", "pump": None, "priority": "high", "text": "x", "raised": "t1"}
    >>> gone = raised | {"is_active": False, "time": "t9", "returned": "t3"}
    >>> [(band["from"], band["to"]) for band in alarm_bands([raised | {"is_active": True, "time": "t1"}, gone])]
    [('t1', 't3')]
    >>> first = raised | {"is_active": True, "time": "t1"}
    >>> worse = first | {"time": "t2", "priority": "urgent", "text": "y"}
    >>> [(band["priority"], band["text"]) for band in alarm_bands([first, worse])]
    [('urgent', 'y')]
    """
    bands: list[Band] = []
    standing: dict[str, Band] = {}
    for change in changes:
        name, raised = change["id"], change.get("raised")
        band = standing.get(name)
        if raised is not None and (band is None or band["from"] != raised):
            if band is not None and band["to"] is None:
                band["to"] = raised
            band = standing[name] = {"priority": change["priority"], "from": raised, "to": None}
            bands.append(band)
        if band is not None and change.get("raised") == band["from"]:
            band["priority"] = max(band["priority"], change["priority"], key=URGENCY.index)
            band.update({key: change.get(key) for key in _OF_BAND})
        if band is not None and not change.get("is_active"):
            band["to"] = band["to"] or change.get("returned") or change["time"]
    return bands
