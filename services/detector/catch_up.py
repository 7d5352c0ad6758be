"""Samples that a detector has missed while it was away, as far as the historian has them."""

import logging
from collections.abc import AsyncIterator

from wetwell.protocols.history_messages import History, HistoryQuery
from wetwell.protocols.keys import history_key
from wetwell.protocols.link import Bus
from wetwell.protocols.messages import MessageError, Sample
from wetwell.protocols.stamps import MAX_STAMP_NS

log = logging.getLogger(__name__)

PAGE = 3_600
ANSWER_S = 10.0


async def missed_samples(bus: Bus, station: str, since_ns: int) -> AsyncIterator[list[Sample]]:
    """Samples after a time, page by page, oldest first; none if no historian answers."""
    start_ns, more = since_ns + 1, True
    while more:
        query = HistoryQuery(kind="samples", start=start_ns, end=MAX_STAMP_NS, points=PAGE, raw=True)
        page = await _answer(bus, station, query)
        if page is None or not page.messages:
            return
        samples = [Sample.model_validate(message) for message in page.messages]
        log.info("station '%s': takes %d samples from the historian", station, len(samples))
        yield samples
        start_ns, more = samples[-1].time + 1, page.more


async def _answer(bus: Bus, station: str, query: HistoryQuery) -> History | None:
    """First good answer; None with a line in the log if there is none."""
    for payload in await bus.ask(history_key(station), query.encode(), timeout_s=ANSWER_S):
        try:
            history = History.decode(payload)
        except MessageError as error:
            log.warning("station '%s': %s", station, error)
            continue
        if not history.error:
            return history
        log.warning("station '%s': the historian says: %s", station, history.error)
    log.info("station '%s': no historian has answered; what the bus keeps must do", station)
    return None
