"""What a browser asks of the other services of the site: history, recordings, acts on alarms."""

from collections.abc import AsyncIterator, Mapping
from typing import Any

from pydantic import ValidationError

from wetwell.protocols.alarm_messages import AlarmAct, AlarmAnswer
from wetwell.protocols.errors import WetwellError, first_fault
from wetwell.protocols.history_messages import History, HistoryQuery
from wetwell.protocols.keys import alarm_act_key, history_key
from wetwell.protocols.link import Bus
from wetwell.protocols.messages import MessageError, PumpReading, Sample
from wetwell.protocols.stamps import to_iso

ANSWER_S = 10.0
ROWS_A_QUESTION = 10_000


class RefusalError(WetwellError):
    """A request that cannot be answered, with the status of HTTP that says why."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


async def act_on_alarm(bus: Bus, station: str, body: bytes, by: str | None = None) -> dict[str, Any]:
    """Answer of the alarm service to an act: an `AlarmAct` in JSON, by whom it says, or by who is known to ask.

    Raises
    ------
    RefusalError
        If the body is no act, or nobody answers.
    """
    try:
        act = AlarmAct.model_validate_json(body)
    except ValidationError as error:
        raise RefusalError(400, first_fault(error)) from error
    if act.station != station:
        raise RefusalError(400, f"station: got '{act.station}', must be '{station}'")
    if by is not None:
        act = act.model_copy(update={"by": by})
    for payload in await bus.ask(alarm_act_key(station), act.encode(), timeout_s=ANSWER_S):
        try:
            answer: dict[str, Any] = AlarmAnswer.decode(payload).model_dump(mode="json")
        except MessageError as error:
            raise RefusalError(502, str(error)) from error
        return answer
    raise RefusalError(504, "the alarm service does not answer")


async def history(bus: Bus, station: str, query: Mapping[str, str], **more: Any) -> History:
    """Answer of the historian to {"kind", "start", "end", "points"}, with an error in it if nobody answers.

    Raises
    ------
    RefusalError
        If that is no question.
    """
    try:
        asked = HistoryQuery.model_validate(dict(query) | more)
    except ValidationError as error:
        raise RefusalError(400, first_fault(error)) from error
    for payload in await bus.ask(history_key(station), asked.encode(), timeout_s=ANSWER_S):
        try:
            return History.decode(payload)
        except MessageError as error:
            return History(station=station, kind=asked.kind, error=str(error))
    return History(station=station, kind=asked.kind, error="the historian does not answer")


async def recording_pieces(bus: Bus, station: str, query: Mapping[str, str]) -> AsyncIterator[str]:
    """Recording of a time span as CSV, a piece at a time.

    Raises
    ------
    RefusalError
        As for `history`; or if nothing was kept of that time.
    """
    start = query.get("start", "")
    span = {"kind": "samples", "end": query.get("end", ""), "points": str(ROWS_A_QUESTION)}
    pumps = 0
    while True:
        answer = await history(bus, station, span | {"start": start}, raw=True)
        samples = [Sample.model_validate(message) for message in answer.messages]
        if not pumps:
            if not samples:
                raise RefusalError(404, "nothing was kept of that time")
            pumps = max(len(sample.pumps) for sample in samples)
            yield ",".join(_columns(pumps)) + "\n"
        yield "".join(_line(sample, pumps) for sample in samples)
        if not answer.more or not samples:
            return
        start = to_iso(samples[-1].time + 1)


def _columns(pumps: int) -> list[str]:
    names = ["time", "level_m", "inflow_m3h"]
    for pump in range(1, pumps + 1):
        names += [f"pump{pump}_{name}" for name in PumpReading.model_fields]
    return names


def _line(sample: Sample, pumps: int) -> str:
    values: list[Any] = [to_iso(sample.time), sample.level_m, sample.inflow_m3h]
    for pump in (*sample.pumps, *[PumpReading()] * (pumps - len(sample.pumps))):
        running = None if pump.running is None else int(pump.running)
        values += [pump.frequency_hz, pump.flow_m3h, pump.head_m, pump.power_kw, running]
    return ",".join("" if value is None else str(value) for value in values) + "\n"
