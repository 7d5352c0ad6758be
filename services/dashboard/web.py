"""The web server within the daemon: begins at once, ends its event streams, then itself."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Iterator

import uvicorn
from starlette.types import ASGIApp

from wetwell.protocols.errors import LinkError
from wetwell.services.dashboard.event_streams import EventStreams

SHUTDOWN_S = 2


class _Server(uvicorn.Server):
    """Leaves the signals to the daemon."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def open_socket(host: str, port: int) -> socket.socket:
    """Socket that listens.

    Raises
    ------
    LinkError
        If the address cannot be listened on.
    """
    try:
        listener = socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET, backlog=512
        )
    except OSError as error:
        raise LinkError(
            f"dashboard {host}:{port}: cannot listen: {(error.strerror or str(error)).lower()}"
        ) from error
    # asyncio does so for sockets that name their protocol; else a body waits 40 ms for the receipt of its head.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener


@contextlib.asynccontextmanager
async def web_server(app: ASGIApp, listener: socket.socket, streams: EventStreams) -> AsyncIterator[None]:
    """Serve until the end of the block."""
    config = uvicorn.Config(
        app, log_config=None, access_log=False, lifespan="off", ws="none", timeout_graceful_shutdown=SHUTDOWN_S
    )
    server = _Server(config)
    serving = asyncio.create_task(server.serve([listener]), name="dashboard.web")
    try:
        yield
    finally:
        streams.close()
        server.should_exit = True
        await serving
