"""What was kept of alarms and verdicts over a time span: bands for the charts, the journal of all stations."""

import asyncio
from collections.abc import Mapping, Sequence
from typing import Any

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.messages.history import History
from wetwell.services.dashboard.past.bands import alarm_bands, verdict_bands
from wetwell.services.dashboard.past.client import history

STATIONS_AT_ONCE = 8
"""Most stations that the historian is asked about at a time."""
MOST_BANDS = 5000
"""Most changes of a station that are drawn."""
MOST_LINES = 500
"""Most lines of the journal."""


async def bands(bus: Bus, station: str, query: Mapping[str, str]) -> dict[str, Any]:
    """Bands of verdicts and alarms of a station in {"start", "end"}, or the `error` of who should know them.

    Alarms are looked for until now: one that stood over the whole span has changed after it, or stands still.

    Raises
    ------
    RefusalError
        If that is no question.
    """
    until_now = {name: value for name, value in query.items() if name == "start"}
    verdicts, alarms = await asyncio.gather(
        history(bus, station, query, kind="changes", points=MOST_BANDS),
        history(bus, station, until_now, kind="alarms", points=MOST_BANDS),
    )
    return {
        "verdicts": verdict_bands(verdicts.messages),
        "alarms": alarm_bands(alarms.messages),
        "error": verdicts.error or alarms.error,
    }


async def journal(bus: Bus, stations: Sequence[str], query: Mapping[str, str]) -> dict[str, Any]:
    """Changes of the alarms of some stations in {"start", "end"}, newest first, with an `error` if nobody answers.

    Raises
    ------
    RefusalError
        If that is no question.
    """
    gate = asyncio.Semaphore(STATIONS_AT_ONCE)

    async def asked(station: str) -> History:
        async with gate:
            return await history(bus, station, query, kind="alarms", points=MOST_LINES)

    answers = await asyncio.gather(*map(asked, stations))
    lines = [message for answer in answers for message in answer.messages]
    lines.sort(key=lambda message: str(message["time"]), reverse=True)
    silent = bool(answers) and all(answer.error for answer in answers)
    return {"lines": lines[:MOST_LINES], "error": answers[0].error if silent else ""}


async def is_kept(bus: Bus, station: str) -> bool:
    """Whether the historian knows a station."""
    answer = await history(bus, station, {}, kind="stations")
    return any(message.get("station") == station for message in answer.messages)
