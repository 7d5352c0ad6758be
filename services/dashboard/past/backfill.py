"""The charts' window before this process was there: asked of the historian for stations that somebody looks at."""

import asyncio
import logging

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.messages.history import LONGEST_NS
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.dashboard.event_streams import EventStreams
from wetwell.services.dashboard.past.client import history
from wetwell.services.dashboard.refusal import RefusalError
from wetwell.services.dashboard.view.sample_row import past_rows
from wetwell.services.dashboard.view.site_view import SiteView

log = logging.getLogger(__name__)

SETTLED_S = 2.0
"""So long after the start the historian has committed what came before."""
AGAIN_S = 30.0
"""After so long a historian that did not answer is asked again, while somebody looks."""
AT_ONCE = 4
"""Most questions that are on the way."""


class ChartBackfill:
    """Fills the charts of stations that are looked at with what was before the first sample that was heard.

    A question is for one second a row, so that stations at 1 Hz get their samples, quicker ones means.

    Parameters
    ----------
    bus : Bus
    view : SiteView
    streams : EventStreams
    """

    def __init__(self, bus: Bus, view: SiteView, streams: EventStreams) -> None:
        self._bus = bus
        self._view = view
        self._streams = streams
        self._ready_s = asyncio.get_running_loop().time() + SETTLED_S
        self._asked: dict[str, tuple[int, float]] = {}
        self._at_once = asyncio.Semaphore(AT_ONCE)

    def wanted(self, now_s: float) -> list[str]:
        """Stations that are looked at whose past has to be asked for now; each is told once."""
        if now_s < self._ready_s:
            return []
        return [name for name in self._streams.topics if self._is_wanted(name, now_s)]

    def _is_wanted(self, name: str, now_s: float) -> bool:
        station = self._view.stations.get(name)
        if station is None or station.sample is None:
            return False
        first_ns, again_s = self._asked.get(name, (None, 0.0))
        if first_ns == station.first_ns and now_s < again_s:
            return False
        self._asked[name] = (station.first_ns, float("inf"))
        return station.room > 0

    async def fill(self, name: str) -> None:
        """Ask for the past of a station and let its pages begin anew with it."""
        station = self._view.stations[name]
        first_ns = station.first_ns
        async with self._at_once:
            rows = await self._rows(name, first_ns, station.room)
        if rows is None:
            self._asked[name] = (first_ns, asyncio.get_running_loop().time() + AGAIN_S)
        elif rows and station.prepend(rows, first_ns):
            self._streams.resync(name)

    async def _rows(self, name: str, end_ns: int, most: int) -> list[str] | None:
        """Rows before a time, oldest first; None if no historian has told."""
        span = {"start": max(end_ns - most * NS_PER_S, -LONGEST_NS), "end": end_ns}
        try:
            answer = await history(self._bus, name, {}, kind="samples", points=most, **span)
        except RefusalError:  # a station in a time that no historian keeps
            return []
        if answer.error:
            log.debug("station '%s': charts begin now: %s", name, answer.error)
            return None
        return past_rows(answer)
