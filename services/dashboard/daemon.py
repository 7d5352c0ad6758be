"""The dashboard daemon: what is on the bus, in a browser."""

import asyncio
import logging
import socket

from wetwell.protocols.keys import SITE
from wetwell.services.bus import connect
from wetwell.services.daemon import report_health, stop_event, until
from wetwell.services.dashboard.app import Desk, dashboard_app
from wetwell.services.dashboard.feed import Feed
from wetwell.services.dashboard.hub import Hub
from wetwell.services.dashboard.site_view import SiteView
from wetwell.services.dashboard.web import open_socket, web_server
from wetwell.services.settings import Settings

log = logging.getLogger(__name__)


async def serve_dashboard(settings: Settings) -> None:
    """Serve the page until stopped. A router that is away is waited for; the page is there meanwhile, without values.

    Raises
    ------
    LinkError
        If the address cannot be listened on.
    """
    listener = open_socket(settings.dashboard.host, settings.dashboard.port)
    async with stop_event() as stop:
        await until(stop, asyncio.create_task(_run(settings, listener), name="dashboard.run"))


async def _run(settings: Settings, listener: socket.socket) -> None:
    desk = Desk(SiteView(settings.dashboard.stale_s), Hub(), settings.dashboard.reports)
    async with web_server(dashboard_app(desk), listener, desk.hub):
        log.info("page on http://%s:%d", *listener.getsockname()[:2])
        with await connect(settings) as bus:
            feed, desk.bus = Feed(bus, desk.view, desk.hub), bus
            async with asyncio.TaskGroup() as group:
                group.create_task(
                    report_health(bus, SITE, "dashboard", settings.health.period_s, feed.figures),
                    name="dashboard.health",
                )
                group.create_task(feed.run(), name="dashboard.feed")
