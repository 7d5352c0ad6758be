"""The router daemon: the meeting point of the bus, for sites that run no router of their own."""

import logging

from wetwell.services.bus import listen
from wetwell.services.daemon import stop_event
from wetwell.services.settings import Settings

log = logging.getLogger(__name__)


async def serve_router(settings: Settings) -> None:
    """Route until stopped.

    Raises
    ------
    LinkError
        If the endpoint cannot be opened.
    """
    async with stop_event() as stop:
        with listen(settings):
            log.info("router on %s", settings.zenoh.endpoint)
            await stop.wait()
