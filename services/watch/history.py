"""What the watch asks the historian: which stations there are, a span of samples, the faults that were told."""

import asyncio
import logging
from typing import get_args

import numpy as np

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import SITE, history_key
from wetwell.protocols.errors import LinkError
from wetwell.protocols.messages.history import Episode, History, HistoryQuery
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import Quality
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import from_iso
from wetwell.sim2real.watch.agreement import ToldFault

log = logging.getLogger(__name__)

PAGE_ROWS = 20_000
"""Rows of an answer: some 2 MB, so that no message is held up for long."""
PAGE_ANSWER_S = 30.0
BAD = get_args(Quality).index("bad")


async def kept_spans(bus: Bus) -> dict[str, tuple[int, int]]:
    """Times of the first and last sample of each station that has some.

    Raises
    ------
    LinkError
        If no historian answers, or it answers with an error.
    """
    answer = await _answer(bus, SITE, HistoryQuery(kind="stations"))
    return {
        message["station"]: (from_iso(message["first"]), from_iso(message["last"]))
        for message in answer.messages
        if message["first"] is not None and message["last"] is not None
    }


async def kept_recording(bus: Bus, station: str, begins_ns: int, ends_ns: int) -> Recording | None:
    """Samples of a span that are not bad, one of each time; None without any.

    Raises
    ------
    LinkError
        If no historian answers, or it answers with an error.
    """
    pages: list[History] = []
    start_ns, more = begins_ns, True
    while more and start_ns < ends_ns:
        query = HistoryQuery(kind="samples", start=start_ns, end=ends_ns, points=PAGE_ROWS, raw=True)
        page = await _answer(bus, station, query)
        more = page.more and bool(page.time)
        if page.time:
            pages.append(page)
            start_ns = page.time[-1] + 1
    return None if not pages else await asyncio.to_thread(_joined, station, pages)


async def told_faults(bus: Bus, station: str, begins_ns: int, ends_ns: int) -> list[ToldFault]:
    """Faults that the detector told of a span.

    Raises
    ------
    LinkError
        If no historian answers, or it answers with an error.
    """
    answer = await _answer(bus, station, HistoryQuery(kind="episodes", start=begins_ns, end=ends_ns))
    episodes = [Episode.model_validate(message) for message in answer.messages]
    return [ToldFault(asset=one.asset, since_ns=one.since, to_ns=one.to) for one in episodes]


async def _answer(bus: Bus, station: str, query: HistoryQuery) -> History:
    for payload in await bus.ask(history_key(station), query.encode(), timeout_s=PAGE_ANSWER_S):
        try:
            answer = await asyncio.to_thread(History.decode, payload)
        except MessageError as error:
            raise LinkError(str(error)) from error
        if answer.error:
            raise LinkError(f"the historian says: {answer.error}")
        return answer
    raise LinkError("the historian does not answer")


def _joined(station: str, pages: list[History]) -> Recording:
    """Pages one after the other, each with the columns that it has."""
    names = dict.fromkeys(name for page in pages for name in page.columns)
    columns = {
        name: np.concatenate(
            [np.array(page.columns.get(name, (None,) * len(page.time)), dtype=np.float64) for page in pages]
        )
        for name in names
    }
    time_ns = np.concatenate([np.array(page.time, dtype=np.int64) for page in pages])
    is_kept = np.r_[True, np.diff(time_ns) > 0] & (columns["quality"] != BAD)
    measured = {name: values[is_kept] for name, values in columns.items() if name not in {"seq", "quality"}}
    return Recording(time_ns=time_ns[is_kept], columns=measured, station=station)
