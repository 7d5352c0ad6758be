"""Changes of state among kept verdicts: what bands and journals draw, without the evidence of every run."""

from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel

from wetwell.protocols.messages.history import LONGEST_NS
from wetwell.services.historian.store.interface import Store

LEAD = 200
"""Verdicts before a span among which the one that stood at its beginning is looked for, for each pump."""
MOST_VERDICTS = 200_000
"""Verdicts that are looked through at most: three pumps with a run each ten minutes for more than a year."""


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


def changes_of(store: Store, station: str, start_ns: int, end_ns: int, points: int) -> tuple[dict[str, Any], ...]:
    """The last so many changes of state or stage of a span, oldest first, with what stood at its beginning.

    Parameters
    ----------
    start_ns, end_ns : int
        The span; a change before it is told for each pump, with its own time.
    """
    before = store.events("verdicts", station, -LONGEST_NS, start_ns, LEAD)
    standing = {verdict.pump: verdict for verdict in changed(before)}
    within = store.events("verdicts", station, start_ns, end_ns, MOST_VERDICTS)
    first = sorted(standing.values(), key=lambda verdict: str(verdict.time))
    found = changed(within, {pump: verdict.form for pump, verdict in standing.items()})
    return tuple(verdict.model_dump() for verdict in [*first, *found][-points:])


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
