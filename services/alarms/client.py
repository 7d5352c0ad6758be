"""Questions to the alarms daemon, over the bus like those of any other client."""

import uuid
from collections.abc import Awaitable, Callable
from typing import TypeVar

from pydantic import ValidationError

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import alarm_act_key, alarm_key, alarm_report_key
from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.messages.alarm import Alarm, AlarmAct, AlarmAnswer, AlarmReport
from wetwell.services.alarms.rules import RANK
from wetwell.services.runtime.client import ask_service, first_answer
from wetwell.services.runtime.settings import Settings

T = TypeVar("T")

ANSWER_S = 10.0
TRY_S = 2.0


async def ask_alarms(settings: Settings, question: Callable[[Bus], Awaitable[T]]) -> T:
    """Answer to a question to the alarms daemon.

    Raises
    ------
    LinkError
        If nobody answers within `ANSWER_S`.
    """
    return await ask_service(settings, question, "no alarms daemon", ANSWER_S)


async def list_alarms(bus: Bus, station: str = "*") -> list[Alarm]:
    """All alarms that are not normal, the most urgent and newest first."""
    await report(bus)  # an empty list must not mean that nobody is there
    alarms = [Alarm.decode(payload) for payload in await bus.ask(alarm_key(station))]
    return sorted(
        (alarm for alarm in alarms if alarm.state != "normal"), key=lambda alarm: (RANK[alarm.priority], -alarm.time)
    )


async def report(bus: Bus) -> AlarmReport:
    """Rates, chattering and stale alarms of the site."""
    return AlarmReport.decode(await first_answer(bus, alarm_report_key(), timeout_s=TRY_S))


async def send_act(bus: Bus, act: AlarmAct) -> AlarmAnswer:
    """Ask for an act until it is answered; by its id it is carried out once."""
    return AlarmAnswer.decode(await first_answer(bus, alarm_act_key(act.station), act.encode(), timeout_s=TRY_S))


def new_act(station: str, alarm: str, act: str, by: str, minutes: float | None, reason: str) -> AlarmAct:
    """An act with an id of its own.

    Raises
    ------
    ConfigError
        If a rule is broken.
    """
    fields = {"station": station, "alarm": alarm, "act": act, "by": by, "minutes": minutes, "reason": reason}
    try:
        return AlarmAct.model_validate({"id": uuid.uuid4().hex, **fields})
    except ValidationError as error:
        raise ConfigError(f"{act}: {first_fault(error)}") from error
