"""Episode: a fault of one asset from its beginning to its end."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Stamp
from wetwell.protocols.messages.verdict import Severity, Stage, State, Trend


class Episode(Message):
    """A fault of one asset, as it was told until `time`; `to` is None while it stands.

    `stage` and `severity` are the worst so far, `trend` is the last; `cost` is what it was expected to cost to wait
    until the next visit, at the worst.
    """

    schema_name: Literal["wetwell.episode/1"] = Field("wetwell.episode/1", alias="schema")
    time: Stamp
    station: str
    asset: str
    state: State
    stage: Stage
    since: Stamp = Field(alias="from")
    to: Stamp | None = None
    severity: Severity | None = None
    trend: Trend | None = None
    advice: str = ""
    cost: float | None = None
