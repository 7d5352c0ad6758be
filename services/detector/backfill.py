"""Samples that a detector has missed while it was away, as far as the historian has them."""

import asyncio
import logging
from collections.abc import AsyncIterator, Iterable
from typing import get_args

import numpy as np

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import history_key
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import Quality, Sample
from wetwell.protocols.recordings.recording import Recording

log = logging.getLogger(__name__)

PAGE = 3_600
ANSWER_S = 10.0
ASK_AGAIN_S = 0.5
PATIENCE_S = 30.0
"""So long a historian that does not answer is asked again: where a machine has started anew, it starts too. [s]"""


async def missed_samples(bus: Bus, station: str, since_ns: int, until_ns: int) -> AsyncIterator[list[Sample]]:
    """Samples between two times, page by page, oldest first; none if no historian answers."""
    start_ns, more = since_ns + 1, True
    while more and start_ns < until_ns:
        query = HistoryQuery(kind="samples", start=start_ns, end=until_ns, points=PAGE, raw=True)
        page = await _answer(bus, station, query)
        if page is None or not page.time:
            return
        log.info("station '%s': takes %d samples from the historian", station, len(page.time))
        yield samples_of(page)
        start_ns, more = page.time[-1] + 1, page.more


def samples_of(page: History) -> list[Sample]:
    """Samples in an answer to a question for raw ones."""
    columns = {
        name: np.array(values, dtype=np.float64)
        for name, values in page.columns.items()
        if name not in {"seq", "quality"}
    }
    recording = Recording(time_ns=np.array(page.time, dtype=np.int64), columns=columns)
    qualities = get_args(Quality)
    return [
        sample.model_copy(update={"seq": int(seq or 0), "quality": qualities[int(quality or 0)]})
        for sample, seq, quality in zip(
            recording.samples(page.station), page.columns["seq"], page.columns["quality"], strict=True
        )
    ]


def first_good(station: str, payloads: Iterable[bytes]) -> History | None:
    """First of some answers that is one, with a line in the log for each before it that is none."""
    for payload in payloads:
        try:
            history = History.decode(payload)
        except MessageError as error:
            log.warning("station '%s': %s", station, error)
            continue
        if not history.error:
            return history
        log.warning("station '%s': the historian says: %s", station, history.error)
    return None


async def _answer(bus: Bus, station: str, query: HistoryQuery) -> History | None:
    """First good answer, within `PATIENCE_S`; None with a line in the log if there is none."""
    clock = asyncio.get_running_loop().time
    end_s = clock() + PATIENCE_S
    while True:
        payloads = await bus.ask(history_key(station), query.encode(), timeout_s=ANSWER_S)
        history = first_good(station, payloads)
        if history is not None:
            return history
        if payloads or clock() > end_s:
            log.info("station '%s': no historian has told; what the bus keeps must do", station)
            return None
        await asyncio.sleep(ASK_AGAIN_S)
