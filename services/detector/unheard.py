"""Whether verdicts that are told no more were heard: the historian knows."""

import asyncio
import logging
from collections import deque
from collections.abc import Sequence

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import history_key
from wetwell.protocols.messages.history import HistoryQuery
from wetwell.protocols.timestamps import to_iso
from wetwell.services.detector.backfill import ANSWER_S, first_good
from wetwell.services.detector.station_detector import StationDetector

log = logging.getLogger(__name__)

ASK_LATER_S = 60.0
"""Where no historian answers, such as while the detector is cut off from it. [s]"""
AT_A_TIME = 1_000
"""Verdicts of one time that an answer may hold: few of each pump."""


async def say_unheard(bus: Bus, judges: Sequence[StationDetector]) -> None:
    """Say of each verdict that lives before have given up, and that the historian does not have, that it is lost.

    Those before it back to the last one that was heard are lost with it. Asks until there is an answer.
    """
    left = deque((judge, pump, time_ns) for judge in judges for pump, time_ns in judge.unproven())
    while left:
        judge, pump, time_ns = left.popleft()
        pumps = await _pumps_heard(bus, judge.station, time_ns)
        if pumps is None:
            left.append((judge, pump, time_ns))
            await asyncio.sleep(ASK_LATER_S)
            continue
        if pump not in pumps:
            _say(judge.station, pump, time_ns)
        judge.prove(pump, time_ns, is_heard=pump in pumps)


async def _pumps_heard(bus: Bus, station: str, time_ns: int) -> set[int] | None:
    """Pumps of which the historian has a verdict of a time; None if it does not say."""
    query = HistoryQuery(kind="verdicts", start=time_ns, end=time_ns + 1, points=AT_A_TIME)
    history = first_good(station, await bus.ask(history_key(station), query.encode(), timeout_s=ANSWER_S))
    if history is None:
        return None
    return {message["pump"] for message in history.messages if isinstance(message.get("pump"), int)}


def _say(station: str, pump: int, time_ns: int) -> None:
    log.warning(
        "station '%s' pump %d: verdicts up to %s are lost: the historian does not have the last of them, "
        "and the detector that told them was started anew",
        station,
        pump,
        to_iso(time_ns),
    )
