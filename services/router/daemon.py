"""The router daemon: the meeting point of the bus, for sites that run no router of their own."""

import logging

from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.bus.zenoh.router_log import relay_router_log
from wetwell.services.runtime.connection import listen
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped
from wetwell.services.runtime.settings import Settings

log = logging.getLogger(__name__)


async def serve_router(settings: Settings) -> None:
    """Route until stopped, and tell in the log whom the router refuses; nothing is printed.

    Raises
    ------
    ConfigError
        If the settings let in everybody from everywhere, or a file that they name cannot be read.
    LinkError
        If the endpoint cannot be opened.
    """
    relay_router_log()
    await run_until_stopped(_run(settings), "router.run")


async def _run(settings: Settings) -> None:
    with listen(settings) as bus:
        log.info("router on %s", settings.zenoh.endpoint)
        await report_health(bus, SITE, "router", settings.health.period_s, dict)
