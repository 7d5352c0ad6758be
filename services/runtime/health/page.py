"""The pages `/metrics` and `/healthz`, served by a thread of their own, so that a hung event loop is seen."""

import contextlib
import json
import logging
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4

from wetwell.protocols.errors import LinkError
from wetwell.services.runtime.health.board import HealthBoard
from wetwell.services.runtime.settings import HealthSettings

log = logging.getLogger(__name__)


@contextlib.contextmanager
def health_page(settings: HealthSettings, board: HealthBoard) -> Iterator[str | None]:
    """Serve the pages while the block runs, if the settings ask for them; yields their address.

    Raises
    ------
    LinkError
        If the address cannot be listened on.
    """
    if settings.http is None:
        yield None
        return
    host, _, port = settings.http.rpartition(":")
    registry = CollectorRegistry()
    registry.register(board)

    class Handler(BaseHTTPRequestHandler):
        timeout = 5.0

        def do_GET(self) -> None:
            if self.path == "/metrics":
                self._send(200, CONTENT_TYPE_PLAIN_0_0_4, generate_latest(registry))
            elif self.path == "/healthz":
                reasons = board.reasons(settings.max_sample_age_s)
                body = json.dumps({"ok": not reasons, "reasons": reasons}).encode()
                self._send(503 if reasons else 200, "application/json", body)
            else:
                self._send(404, "text/plain", b"/metrics or /healthz\n")

        def _send(self, status: int, kind: str, body: bytes) -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class names it so
            log.debug(format, *args)

    try:
        server = ThreadingHTTPServer((host, int(port)), Handler)
    except OSError as error:
        raise LinkError(f"health.http {settings.http}: cannot listen: {error.strerror or error}") from error
    thread = threading.Thread(target=server.serve_forever, name="health", daemon=True)
    thread.start()
    try:
        yield f"{host}:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
