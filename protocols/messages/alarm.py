"""Messages on alarms, after ISA-18.2: the alarm itself, an act of an operator on it, the answer."""

from typing import Annotated, Literal, Self, get_args

from pydantic import Field, model_validator

from wetwell.protocols.messages.message import Message, Stamp
from wetwell.protocols.messages.verdict import Severity, Stage, Trend

AlarmState = Literal[
    "normal",
    "unacknowledged",
    "acknowledged",
    "returned",
    "latched_unacknowledged",
    "latched_acknowledged",
    "shelved",
    "suppressed",
    "out_of_service",
]
"""ISA-18.2: normal (A), unacknowledged alarm (B), acknowledged alarm (C), returned to normal unacknowledged (D),
latched unacknowledged (E), latched acknowledged (F), shelved (G), suppressed by design (H), out of service (I)."""

Priority = Literal["advisory", "low", "medium", "high", "urgent"]
"""An advisory calls nobody and waits for no acknowledgement."""

Mode = Literal["maintenance", "stopped"]
"""Of a station: somebody works on it; it is not to run. Alarms that would be its consequence are suppressed."""

Act = Literal["acknowledge", "reset", "shelve", "unshelve", "out_of_service", "in_service"]
ModeAct = Literal["maintenance", "stop", "resume"]

STATION = "station"
"""In place of an alarm: an act on the mode of the station."""

Name = Annotated[str, Field(min_length=1, max_length=64)]
AlarmName = Annotated[str, Field(min_length=1, max_length=128)]

RuleName = Literal[
    "pump_fault",
    "system_fault",
    "pump_and_system_fault",
    "sensor_fault",
    "model_gap",
    "level_high",
    "overflow_risk",
    "samples_stale",
    "plc_stopped",
    "plc_lost",
    "detector_silent",
    "gateway_silent",
    "historian_silent",
    "bus_lost",
]
"""Kinds of alarms."""


class Alarm(Message):
    """An alarm after its last change.

    Parameters
    ----------
    id : str
        Names the condition, such as `pump2.pump_fault`, and stays the same.
    time : stamp
        Of the last change, in the time of the station.
    pump : int, optional
        Which one, counted from 1; none for an alarm of the station.
    asset : str, optional
        What is at fault: `pump:2`, `main`, `main:line 1` or `sensor:pump2_flow_m3h`.
    stage : str, optional
        What to do: keep an eye on it (`watch`), plan a visit (`plan`), go (`act`).
    severity : Severity, optional
        How bad the fault is.
    trend : Trend, optional
        How it grows.
    priority : str
        How soon somebody has to act; an advisory calls nobody.
    state : str
        After ISA-18.2: normal (A), unacknowledged (B), acknowledged (C), returned to normal unacknowledged (D),
        latched unacknowledged (E), latched acknowledged (F), shelved (G), suppressed by design (H), out of
        service (I).
    is_active : bool
        Whether the condition holds now.
    text : str
        What is the matter, for people.
    advice : str
        What to do.
    raised, returned, acknowledged : stamp, optional
        When the condition last came, last went, and was last acknowledged, in the time of the station.
    by : str, optional
        Who acted last.
    until : stamp, optional
        When a shelved alarm comes back, on the wall clock.
    reason : str
        What was said at the last act, or why it is suppressed.
    """

    schema_name: Literal["wetwell.alarm/1"] = Field("wetwell.alarm/1", alias="schema")
    id: AlarmName
    time: Stamp
    station: str
    pump: int | None = Field(None, ge=1)
    asset: str | None = None
    stage: Stage | None = None
    severity: Severity | None = None
    trend: Trend | None = None
    priority: Priority
    state: AlarmState
    is_active: bool
    text: str
    advice: str = ""
    raised: Stamp | None = None
    returned: Stamp | None = None
    acknowledged: Stamp | None = None
    by: str | None = None
    until: Stamp | None = None
    reason: str = ""


class AlarmAct(Message):
    """What an operator does to an alarm.

    Of the alarm "station" it is an act on the mode of the station: under maintenance, stopped, or neither again.

    Parameters
    ----------
    id : str
        Of the act; makes it safe to ask twice.
    alarm : str
        `id` of the alarm, or "station".
    act : str
        What is done.
    by : str
        Who does it.
    minutes : float, optional
        For how long it is shelved. [min]
    reason : str
        Why, for the audit.
    """

    schema_name: Literal["wetwell.alarm-act/1"] = Field("wetwell.alarm-act/1", alias="schema")
    id: Name
    station: str
    alarm: AlarmName
    act: Act | ModeAct
    by: Name
    minutes: float | None = Field(None, gt=0.0, le=7 * 24 * 60)
    reason: str = Field("", max_length=500)

    @model_validator(mode="after")
    def _a_shelf_has_an_end(self) -> Self:
        if self.act == "shelve" and self.minutes is None:
            raise ValueError("minutes must be given to shelve an alarm")
        if (self.act in get_args(ModeAct)) != (self.alarm == STATION):
            raise ValueError(f"act: got '{self.act}' for '{self.alarm}', an act on the mode is one on '{STATION}'")
        return self


class AlarmAnswer(Message):
    """What came of an act.

    Parameters
    ----------
    id : str
        Of the act.
    is_done : bool
        Whether it was done.
    reason : str
        Why nothing was done.
    alarm : Alarm, optional
        As it is now.
    """

    schema_name: Literal["wetwell.alarm-answer/1"] = Field("wetwell.alarm-answer/1", alias="schema")
    id: str
    is_done: bool
    reason: str = ""
    alarm: Alarm | None = None


class AlarmFigure(Message):
    """An alarm on a list.

    Parameters
    ----------
    alarm : str
        `id` of the alarm.
    transitions : int, optional
        Changes within the last hour, on the list of those that chatter.
    raised : stamp, optional
        Since when it stands, on the list of those that stand long.
    """

    station: str
    alarm: str
    transitions: int | None = None
    raised: Stamp | None = None


class AlarmReport(Message):
    """How well the alarms of a site serve its operators. `rates` on the wall clock, lists in the stations' time.

    Parameters
    ----------
    rates : dict
        `alarms_10min`, `alarms_hour`, `alarms_day` (calls in the last ten minutes, hour and day), `peak_10min` (most
        in any ten minutes of the last day), `flood_share` (of the day's ten minutes), `is_flood`.
    standing : dict
        How many alarms are in each state.
    chattering : list of AlarmFigure
        Alarms that come and go, the worst first.
    stale : list of AlarmFigure
        Alarms that stand long, the oldest first.
    """

    schema_name: Literal["wetwell.alarm-report/1"] = Field("wetwell.alarm-report/1", alias="schema")
    time: Stamp
    rates: dict[str, float]
    standing: dict[AlarmState, int]
    chattering: tuple[AlarmFigure, ...] = ()
    stale: tuple[AlarmFigure, ...] = ()
