"""Questions to the historian, and what it answers."""

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from wetwell.protocols.messages import Message, Number, Stamp

Kind = Literal["samples", "verdicts", "alarms", "kpi"]


class HistoryQuery(Message):
    """What was kept of a station from `start` until before `end`.

    Of samples and KPI at most `points` rows come: means, least and largest of equal spans if there are more (columns
    `level_m`, `level_m_min`, `level_m_max`, ...). Of verdicts and alarms the last `points` come. `raw` asks for the
    samples as they came, with `seq` and `quality`: the first `points` of them as messages, oldest first, and whether
    there are `more` (ask again from after the last one).
    """

    schema_name: Literal["wetwell.history-query/1"] = Field("wetwell.history-query/1", alias="schema")
    kind: Kind
    start: Stamp
    end: Stamp
    points: int = Field(1000, ge=1, le=100_000)
    raw: bool = False

    @model_validator(mode="after")
    def _ends_after_its_start(self) -> Self:
        if self.end <= self.start:
            raise ValueError("end must lie after start")
        return self


class History(Message):
    """Answer to a `HistoryQuery`: columns of samples and KPI, messages of all else (raw samples too), or an error."""

    schema_name: Literal["wetwell.history/1"] = Field("wetwell.history/1", alias="schema")
    station: str
    kind: Kind
    time: tuple[Stamp, ...] = ()
    columns: dict[str, tuple[Number, ...]] = Field(default_factory=dict)
    messages: tuple[dict[str, Any], ...] = ()
    more: bool = False
    error: str = ""
