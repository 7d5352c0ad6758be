"""What stands before every answer: whose requests are heard, and what a browser may do with the page."""

from collections.abc import Mapping
from functools import partial
from http.cookies import SimpleCookie
from pathlib import Path
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wetwell.protocols.errors import ConfigError
from wetwell.services.dashboard.entries import Entries
from wetwell.services.dashboard.refusal import RefusalError
from wetwell.services.security.exposure import is_loopback
from wetwell.services.security.tokens import Holder, holder_of

COOKIE = "wetwell_token"
MOST_BODY_BYTES = 65_536
"""Of a request: an act is short, and whoever has no token must not fill the memory."""
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
_GUARDED = ("/events", "/api/", "/reports/", "/metrics")
_LOGIN = "/api/login"
_OPEN = (_LOGIN, "/api/who")
_NEEDED = (401, "a token is needed")
_NOT_ENCODED = (400, "what is asked must be percent-encoded")


class Guard:
    """Refuses who may not ask, and requests that a foreign web page makes the browser send; sets the safe headers.

    Without tokens the page is for this machine: a request by any other host name comes by one that was made to point
    here. With tokens every request for data must bring one, as `Authorization: Bearer` or as the cookie that the
    login sets. An act (anything but GET and HEAD) must be JSON, come from this page itself, and needs an operator.
    Where an address has tried too many wrong tokens, it is told to wait; a right one is heard all the same.

    Parameters
    ----------
    app : ASGIApp
    tokens_file : Path, optional
        File of tokens.
    entries : Entries
        Hears of each token that is refused.
    is_local : bool
        Whether only names of this machine are heard.
    """

    def __init__(self, app: ASGIApp, tokens_file: Path | None, entries: Entries, *, is_local: bool) -> None:
        self._app = app
        self._tokens_file = tokens_file
        self._entries = entries
        self._is_local = is_local

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        path, headers = scope["path"], Headers(scope=scope)
        policy = REPORT_POLICY if path.startswith("/reports/") else PAGE_POLICY

        async def send_safe(message: Message) -> None:
            if message["type"] == "http.response.start":
                safe = MutableHeaders(scope=message)
                safe["content-security-policy"] = policy
                for name, value in _HEADERS.items():
                    safe[name] = value
            await send(message)

        refusal = (
            (foreign_name(headers) if self._is_local else None)
            or foreign_act(scope["method"], headers)
            or (None if scope["query_string"].isascii() else _NOT_ENCODED)
        )
        if refusal is None and self._tokens_file is not None:
            token = token_in(headers)
            holder, refusal = self._admitted(scope["method"], path, token)
            is_wrong = token and holder is None and path.startswith(_GUARDED) and path != _LOGIN
            if is_wrong and refusal in {None, _NEEDED}:
                refusal = await self._entries.refuse(token, scope) or refusal
            elif refusal and holder is not None:
                await self._entries.forbid(holder, scope)
            state = scope.setdefault("state", {})
            state["holder"] = holder
            state["is_admitted"] = partial(self._is_admitted, path, token)
        if refusal:
            status, reason = refusal
            await JSONResponse({"error": reason}, status)(scope, receive, send_safe)
            return
        await self._app(scope, bounded(receive), send_safe)

    def _is_admitted(self, path: str, token: str) -> bool:
        """Whether who was let in still is: a stream may outlive its token."""
        return self._admitted("GET", path, token)[1] is None

    def _admitted(self, method: str, path: str, token: str) -> tuple[Holder | None, tuple[int, str] | None]:
        """Who asks, and why that is refused, if it is."""
        if not path.startswith(_GUARDED):
            return None, None
        try:
            holder = holder_of(self._tokens_file, token) if self._tokens_file is not None and token else None
        except ConfigError:
            return None, (503, "the tokens cannot be read: nobody is let in")
        if path in _OPEN:
            return holder, None
        if holder is None:
            return None, _NEEDED
        if method not in {"GET", "HEAD"} and not holder.may("operator"):
            return holder, (403, f"'{holder.name}' may look, not act")
        return holder, None


def bounded(receive: Receive) -> Receive:
    """What a client sends, as long as it is no more than `MOST_BODY_BYTES`; then it is refused."""
    count = 0

    async def receive_bounded() -> Message:
        nonlocal count
        message = await receive()
        count += len(message.get("body", b""))
        if count > MOST_BODY_BYTES:
            raise RefusalError(413, f"body: must be no more than {MOST_BODY_BYTES} bytes")
        return message

    return receive_bounded


def token_in(headers: Mapping[str, str]) -> str:
    """Token that a request brings; empty without one.

    Examples
    --------
    >>> token_in({"authorization": "Bearer one"}), token_in({"cookie": "wetwell_token=two"}), token_in({})
    ('one', 'two', '')
    """
    scheme, _, token = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return token.strip()
    cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    return "" if cookie is None else cookie.value


def foreign_name(headers: Mapping[str, str]) -> tuple[int, str] | None:
    """Refusal of a request by a name that is none of this machine's.

    Examples
    --------
    >>> foreign_name({"host": "localhost:8080"}), foreign_name({"host": "evil.example"})
    (None, (421, "host: got 'evil.example', this page is for its own machine only"))
    """
    host = headers.get("host", "")
    if is_loopback(_name(host)):
        return None
    return 421, f"host: got '{host}', this page is for its own machine only"


def foreign_act(method: str, headers: Mapping[str, str]) -> tuple[int, str] | None:
    """Refusal of an act that another page may have sent: it is no JSON, or says that it comes from elsewhere."""
    if method in {"GET", "HEAD"}:
        return None
    if headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        return 415, "content-type: must be application/json"
    origin = headers.get("origin")
    if origin is not None and urlsplit(origin).netloc != headers.get("host", ""):
        return 403, f"origin: got '{origin}', must be this page"
    return None


def _name(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""
