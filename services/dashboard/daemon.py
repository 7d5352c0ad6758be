"""The dashboard daemon: what is on the bus, in a browser."""

import asyncio
import logging
import socket

from wetwell.protocols.bus.keys import SITE
from wetwell.services.dashboard.app import AppState, dashboard_app
from wetwell.services.dashboard.event_streams import EventStreams
from wetwell.services.dashboard.feed import Feed
from wetwell.services.dashboard.view.metrics import StationMetrics
from wetwell.services.dashboard.view.site_view import SiteView
from wetwell.services.dashboard.web import open_socket, web_server
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.health.board import BOARD
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped
from wetwell.services.runtime.settings import Settings
from wetwell.services.security.audit import audit_in
from wetwell.services.security.exposure import check_exposure, is_loopback

log = logging.getLogger(__name__)


async def serve_dashboard(settings: Settings) -> None:
    """Serve the page until stopped. A router that is away is waited for; the page is there meanwhile, without values.

    Raises
    ------
    ConfigError
        If others would reach the page and no tokens are asked for.
    LinkError
        If the address cannot be listened on.
    """
    check_exposure(
        "dashboard.host",
        settings.dashboard.host,
        is_protected=settings.security.tokens_file is not None,
        remedy="security.tokens_file (wetwell token new)",
        insecure=settings.security.insecure,
    )
    listener = open_socket(settings.dashboard.host, settings.dashboard.port)
    await run_until_stopped(_run(settings, listener), "dashboard.run")


async def _run(settings: Settings, listener: socket.socket) -> None:
    tokens_file = settings.security.tokens_file
    app_state = AppState(SiteView(settings.dashboard.stale_s), EventStreams(), settings.dashboard.reports)
    BOARD.others.append(StationMetrics(app_state.view))
    is_local = tokens_file is None and is_loopback(settings.dashboard.host)
    audit = audit_in(settings.security.audit_dir, "dashboard")
    app = dashboard_app(app_state, tokens_file, audit, is_local=is_local)

    def figures() -> dict[str, float]:
        return feed.figures() | {"audit_errors": float(audit.errors)}

    async with web_server(app, listener, app_state.streams):
        log.info("page on http://%s:%d", *listener.getsockname()[:2])
        with await connect(settings) as bus:
            feed, app_state.bus = Feed(bus, app_state.view, app_state.streams), bus
            async with asyncio.TaskGroup() as group:
                group.create_task(
                    report_health(bus, SITE, "dashboard", settings.health.period_s, figures),
                    name="dashboard.health",
                )
                group.create_task(feed.run(), name="dashboard.feed")
