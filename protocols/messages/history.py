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
    (columns `level_m`, `level_m_min`, `level_m_max`, ...), `time` being the beginning of each span. Of `kpi` hours
    come, or if they are more than `points` days, and of these the last `points`. Of verdicts, alarms and acts of
    maintenance the last `points` come, of episodes those that reach into the span. `changes` are the verdicts of
    which state, asset or stage is another than before, without their evidence, and for each pump the one that stood
    at `start`. `stations`, asked about the station `_site`, gives a message for each station, else for the one asked
    about, with the times of its `first` and `last` sample; a stamp that lies more than a day ahead of all others is
    not the last one until ten of that time are there.

    Parameters
    ----------
    kind : str
        What is asked for.
    start, end : stamp
        First time, and the time before which it ends.
    points : int
        Most rows or messages of the answer.
    raw : bool
        Whether the samples themselves are asked for, oldest first, with the columns `seq` and `quality` (0 good,
        1 uncertain, 2 bad).
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
    """Answer to a `HistoryQuery`: columns of samples and KPI, messages of all else, or an error.

    Parameters
    ----------
    kind : str
        What was asked for.
    time : list of stamp
        Of each row of the columns.
    columns : dict
        Values by the name of their column.
    messages : list of dict
        As they were on the bus.
    more : bool
        Whether there are more samples than the answer holds.
    error : str
        Why there is no answer.
    """

    schema_name: Literal["wetwell.history/1"] = Field("wetwell.history/1", alias="schema")
    station: str
    kind: Kind
    time: tuple[Stamp, ...] = ()
    columns: dict[str, tuple[Number, ...]] = Field(default_factory=dict)
    messages: tuple[dict[str, Any], ...] = ()
    more: bool = False
    error: str = ""


class Episode(Message):
    """A fault of one asset, as it was told until `time`.

    Parameters
    ----------
    asset : str
        `pump:2`, `main`, `main:line 1` or `sensor:pump2_flow_m3h`.
    state : str
        What is different.
    stage : str
        The worst so far: `watch`, `plan` or `act`.
    from : stamp
        When it began.
    to : stamp, optional
        When it ended; none while it stands.
    severity : Severity, optional
        The worst so far.
    trend : Trend, optional
        The last.
    advice : str
        What a crew should do, in a sentence.
    cost : float, optional
        What it was expected to cost to wait until the next visit, at the worst, in the currency of the costs.
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
