"""Questions to the historian, and what it answers."""

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from wetwell.protocols.messages.message import Message, Number, Stamp
from wetwell.protocols.messages.verdict import Severity, Stage, State, Trend
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S

Kind = Literal["samples", "verdicts", "changes", "alarms", "episodes", "maintenance", "kpi", "stations"]

LONGEST_NS = MAX_STAMP_NS - 2 * 86_400 * NS_PER_S
"""Times further from 1970 are not kept; it is in the year 2262."""


class HistoryQuery(Message):
    """What was kept of a station from `start` until before `end`; without them, all.

    Of samples at most `points` rows come: if there are more, the means, least and largest values of equal spans
    (columns `level_m`, `level_m_min`, `level_m_max`, ...), `time` being the beginning of each span. `raw` asks for
    the samples themselves, oldest first, up to `points`, with the columns `seq` and `quality` (0 good, 1 uncertain,
    2 bad); the answer then says whether there are `more`. Of `kpi` hours come, or if they are more than `points`
    days, and of these the last `points`. Of verdicts, alarms and acts of maintenance the last `points` come, of
    episodes those that reach into the span. `changes` are the verdicts of which state, asset or stage is another than
    before, without their evidence, and for each pump the one that stood at `start`. `stations`, asked about the
    station `_site`, gives a message for each station, with the times of its `first` and `last` sample; a stamp that
    lies more than a day ahead of all others is not the last one until ten of that time are there.
    """

    schema_name: Literal["wetwell.history-query/1"] = Field("wetwell.history-query/1", alias="schema")
    kind: Kind
    start: Stamp = -LONGEST_NS
    end: Stamp = LONGEST_NS
    points: int = Field(1000, ge=1, le=100_000)
    raw: bool = False

    @model_validator(mode="after")
    def _ends_after_its_start(self) -> Self:
        if self.end <= self.start:
            raise ValueError("end must lie after start")
        return self


class History(Message):
    """Answer to a `HistoryQuery`: columns of samples and KPI, messages of all else, or an error."""

    schema_name: Literal["wetwell.history/1"] = Field("wetwell.history/1", alias="schema")
    station: str
    kind: Kind
    time: tuple[Stamp, ...] = ()
    columns: dict[str, tuple[Number, ...]] = Field(default_factory=dict)
    messages: tuple[dict[str, Any], ...] = ()
    more: bool = False
    error: str = ""


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
