"""Changes of state among verdicts: what bands and journals draw, without the evidence of every run."""

from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel

from wetwell.protocols.messages.history import LONGEST_NS
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import from_iso, to_iso
from wetwell.services.historian.store.interface import EventRow, Store, StoreError

LEAD = 200
"""Rows before a span among which the one that stood at its beginning is looked for, for each pump."""
MOST_ROWS = 200_000
"""Rows that are looked through at most: verdicts of three pumps with a run each ten minutes for more than a year."""


class Told(BaseModel):
    """What is told of a verdict, as it was stored. The rest, above all the evidence, is not made into objects."""

    time: Any
    pump: int
    state: str
    asset: str | None = None
    stage: str | None = None
    severity: dict[str, Any] | None = None

    @property
    def form(self) -> tuple[Any, ...]:
        """What another verdict must say otherwise to be news."""
        return self.state, self.asset, self.stage


class ChangeKeeper:
    """Finds the verdicts that say something else of their pump than the one before, and goes on where the store ends.

    The first verdict of each pump that it sees is one of them. So what a store holds since its first row is whole,
    and a verdict that was kept without its row is told when the publisher sends it again.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._last: dict[str, dict[int, tuple[int, tuple[Any, ...]]]] = {}

    def rows(self, verdict: Verdict) -> list[EventRow]:
        """The row to keep after a verdict, if it says something else; none for one that came late."""
        last = self._last.get(verdict.station)
        if last is None:
            last = self._last[verdict.station] = self._kept(verdict.station)
        severity = None if verdict.severity is None else verdict.severity.model_dump(mode="json")
        told = Told(
            time=to_iso(verdict.time),
            pump=verdict.pump,
            state=verdict.state,
            asset=verdict.asset,
            stage=verdict.stage,
            severity=severity,
        )
        before = last.get(verdict.pump)
        if before is not None and (verdict.time < before[0] or told.form == before[1]):
            return []
        last[verdict.pump] = verdict.time, told.form
        return [EventRow("changes", verdict.station, verdict.time, told.model_dump_json().encode())]

    def _kept(self, station: str) -> dict[int, tuple[int, tuple[Any, ...]]]:
        try:
            rows = self._store.events("changes", station, -LONGEST_NS, LONGEST_NS, LEAD)
        except StoreError:
            return {}
        return {told.pump: (from_iso(told.time), told.form) for told in map(Told.model_validate_json, rows)}


def changes_of(store: Store, station: str, start_ns: int, end_ns: int, points: int) -> tuple[dict[str, Any], ...]:
    """The last so many changes of state or stage of a span, oldest first, with what stood at its beginning.

    Parameters
    ----------
    start_ns, end_ns : int
        The span; a change before it is told for each pump, with its own time.
    """
    before = store.events("changes", station, -LONGEST_NS, start_ns, LEAD)
    since_ns = from_iso(Told.model_validate_json(before[0]).time) if before else start_ns
    earlier = store.events("verdicts", station, -LONGEST_NS, since_ns, LEAD) if len(before) < LEAD else []
    standing = {told.pump: told for told in [*changed(earlier), *changed(before)]}  # of earlier versions, and kept
    older = verdicts_of_before(store, station, start_ns, end_ns, MOST_ROWS)
    within = [*older, *store.events("changes", station, start_ns, end_ns, MOST_ROWS)]
    first = sorted(standing.values(), key=lambda told: str(told.time))
    found = changed(within, {pump: told.form for pump, told in standing.items()})
    return tuple(told.model_dump() for told in [*first, *found][-points:])


def verdicts_of_before(store: Store, station: str, start_ns: int, end_ns: int, most: int) -> list[bytes]:
    """The last so many verdicts of the part of a span from before changes were kept, as by earlier versions."""
    if store.events("changes", station, -LONGEST_NS, start_ns, 1):
        return []
    kept = store.events("changes", station, start_ns, end_ns, MOST_ROWS)
    until_ns = from_iso(Told.model_validate_json(kept[0]).time) if kept else end_ns
    return store.events("verdicts", station, start_ns, until_ns, most) if until_ns > start_ns else []


def changed(payloads: Iterable[bytes], standing: dict[int, tuple[Any, ...]] | None = None) -> list[Told]:
    """Verdicts that say something else of their pump than the one before.

    Examples
    --------
    >>> told = [b'{"time":1,"pump":1,"state":"normal"}', b'{"time":2,"pump":1,"state":"normal"}']
    >>> [verdict.time for verdict in changed(told)]
    [1]
    """
    forms = dict(standing or {})
    found = []
    for payload in payloads:
        verdict = Told.model_validate_json(payload)
        if forms.get(verdict.pump) != verdict.form:
            forms[verdict.pump] = verdict.form
            found.append(verdict)
    return found
