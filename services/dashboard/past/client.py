"""What a browser asks of the other services of the site: history, recordings, acts on alarms."""

import asyncio
import json
import uuid
from collections.abc import AsyncIterator, Mapping, Sequence
from itertools import zip_longest
from typing import Any

from pydantic import ValidationError

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import alarm_act_key, history_key, plant_clock_key
from wetwell.protocols.errors import first_fault
from wetwell.protocols.messages.alarm import AlarmAct, AlarmAnswer
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.maintenance import MaintenanceAct
from wetwell.protocols.messages.message import MessageError, Number
from wetwell.protocols.messages.plant_clock import PlantClock, PlantClockOrder
from wetwell.protocols.messages.readings import row_values
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.quantities import columns_of
from wetwell.protocols.recordings.origin import Origin
from wetwell.protocols.timestamps import to_iso
from wetwell.services.dashboard.refusal import RefusalError
from wetwell.services.runtime.maintenance import entered

ANSWER_S = 10.0
ROWS_A_QUESTION = 10_000
_NO_COLUMNS = frozenset({"seq", "quality"})
"""Of raw samples the historian tells these too; a recording has no column for them."""


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


async def enter_act(bus: Bus, station: str, body: bytes, by: str | None = None) -> dict[str, Any]:
    """Record of an act of maintenance: {"asset", "act", "found", "by", "at"} in JSON, by whom it says or who asks.

    Raises
    ------
    RefusalError
        If the body is no act, or the detector does not know the asset, or nobody answers.
    """
    try:
        fields = json.loads(body)
        if not isinstance(fields, dict):
            raise RefusalError(400, f"act: got {type(fields).__name__}, must be an object")
        named = {name: fields[name] for name in ("asset", "act", "found", "by") if name in fields}
        named |= {"id": uuid.uuid4().hex, "station": station, "time": fields.get("at")}
        act = MaintenanceAct.model_validate(named if by is None else named | {"by": by})
    except ValidationError as error:
        raise RefusalError(400, first_fault(error)) from error
    except (ValueError, RecursionError) as error:
        raise RefusalError(400, f"act: is no JSON: {error}") from error
    try:
        record = await asyncio.wait_for(entered(bus, act), ANSWER_S)
    except TimeoutError:
        raise RefusalError(504, "the detector does not answer") from None
    if record.refused:
        raise RefusalError(400, record.refused)
    return record.model_dump(mode="json")


def plant_clock_order(body: bytes) -> PlantClockOrder:
    """Order to the clock of a simulated plant, in JSON.

    Raises
    ------
    RefusalError
        If the body is none.
    """
    try:
        return PlantClockOrder.model_validate_json(body)
    except ValidationError as error:
        raise RefusalError(400, first_fault(error)) from error


async def set_plant_clock(bus: Bus, station: str, order: PlantClockOrder) -> dict[str, Any]:
    """How the clock of a simulated plant stands after an order.

    Raises
    ------
    RefusalError
        If it is not carried out, or nobody answers.
    """
    for payload in await bus.ask(plant_clock_key(station), order.encode(), timeout_s=ANSWER_S):
        try:
            clock = PlantClock.decode(payload)
        except MessageError as error:
            raise RefusalError(502, str(error)) from error
        if clock.error:
            raise RefusalError(400, clock.error)
        return clock.model_dump(mode="json")
    raise RefusalError(504, f"station '{station}' has no simulated plant")


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
        As for `history`; or if the historian refuses, or nothing was kept of that time.
    """
    start = query.get("start", "")
    span = {"kind": "samples", "end": query.get("end", ""), "points": str(ROWS_A_QUESTION)}
    names: list[str] = []
    while True:
        answer = await history(bus, station, span | {"start": start}, raw=True)
        if answer.error:
            raise RefusalError(502, answer.error)
        time_ns, columns = _as_columns(answer)
        if not names:
            if not time_ns:
                raise RefusalError(404, "nothing was kept of that time")
            names = list(columns)
            yield Origin(station=station).mark + ",".join(["time", *names]) + "\n"
        blank = [None] * len(time_ns)
        rows = zip(map(to_iso, time_ns), *(columns.get(name, blank) for name in names), strict=True)
        yield "".join(",".join("" if value is None else str(value) for value in row) + "\n" for row in rows)
        if not answer.more or not time_ns:
            return
        start = to_iso(time_ns[-1] + 1)


def _as_columns(answer: History) -> tuple[Sequence[int], Mapping[str, Sequence[Number]]]:
    """Stamps and columns of a recording in an answer, which holds the samples as columns or as messages."""
    if not answer.messages:
        return answer.time, {name: values for name, values in answer.columns.items() if name not in _NO_COLUMNS}
    samples = [Sample.model_validate(message) for message in answer.messages]
    names = columns_of(max(len(sample.pumps) for sample in samples))
    columns = zip(names, zip_longest(*map(row_values, samples)), strict=True)
    return [sample.time for sample in samples], {
        name: [None if value is None else float(value) for value in values] for name, values in columns
    }
