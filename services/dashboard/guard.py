"""What stands before every answer: whose requests are heard, and what a browser may do with the page."""

from collections.abc import Mapping
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})

PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; sandbox"
)
"""Reports are files of others with styles of their own: they may show, and nothing else."""

_HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
}


class Guard:
    """Refuses requests that a foreign web page makes the browser send, and sets the headers that keep the page safe.

    The page listens on loopback: a request for any other host name comes by a name that was made to point here. An
    act (anything but GET and HEAD) must be JSON and come from this page itself.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        policy = REPORT_POLICY if scope["path"].startswith("/reports/") else PAGE_POLICY

        async def send_safe(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["content-security-policy"] = policy
                for name, value in _HEADERS.items():
                    headers[name] = value
            await send(message)

        refusal = refused(scope["method"], Headers(scope=scope))
        if refusal:
            status, reason = refusal
            await JSONResponse({"error": reason}, status)(scope, receive, send_safe)
            return
        await self._app(scope, receive, send_safe)


def refused(method: str, headers: Mapping[str, str]) -> tuple[int, str] | None:
    """Status and reason of a request that is not heard; None if it is.

    Examples
    --------
    >>> refused("GET", {"host": "127.0.0.1:8080"}), refused("GET", {"host": "evil.example"})
    (None, (421, "host: got 'evil.example', this page is served on loopback only"))
    """
    host = headers.get("host", "")
    if urlsplit(f"//{host}").hostname not in LOOPBACK:
        return 421, f"host: got '{host}', this page is served on loopback only"
    if method in {"GET", "HEAD"}:
        return None
    if headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        return 415, "content-type: must be application/json"
    origin = headers.get("origin")
    if origin is not None and urlsplit(origin).netloc != host:
        return 403, f"origin: got '{origin}', must be this page"
    return None
