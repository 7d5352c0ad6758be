"""Who looks at the page: a token once, then a cookie that scripts cannot read."""

import contextlib
import json
import time
from collections.abc import AsyncGenerator
from pathlib import Path

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from wetwell.services.dashboard.entries import Entries
from wetwell.services.dashboard.guard import COOKIE
from wetwell.services.security.tokens import Holder, holder_of

COOKIE_S = 30 * 24 * 3600
CHECK_S = 10.0
"""So often an open stream asks whether its token still holds."""


class Login:
    """Answers on who asks; without a file of tokens nobody needs one."""

    def __init__(self, tokens_file: Path | None, entries: Entries) -> None:
        self._tokens_file = tokens_file
        self._entries = entries

    async def who(self, request: Request) -> Response:
        """Whether a token is needed, and who has brought one."""
        return JSONResponse(self._told(holder_in(request)), headers={"cache-control": "no-store"})

    async def enter(self, request: Request) -> Response:
        """Take {"token"}; a right one comes back as a cookie, an empty one takes the cookie away."""
        try:
            token = str(json.loads(await request.body())["token"])
        except (ValueError, KeyError, TypeError, RecursionError):
            return JSONResponse({"error": "token: must be given"}, 400)
        holder = None if self._tokens_file is None else holder_of(self._tokens_file, token)
        answer = JSONResponse(self._told(holder), headers={"cache-control": "no-store"})
        if holder is None:
            refusal = await self._entries.refuse(token, request.scope) if token and self._tokens_file else None
            if refusal is not None:
                status, reason = refusal
                return JSONResponse({"error": reason}, status)
            if (gone := holder_in(request)) is not None and not token:
                await self._entries.leave(gone, request.scope)
            answer.delete_cookie(COOKIE)
        else:
            await self._entries.enter(holder, request.scope)
            secure = request.url.scheme == "https"
            answer.set_cookie(COOKIE, token, max_age=COOKIE_S, httponly=True, samesite="strict", secure=secure)
        return answer

    def _told(self, holder: Holder | None) -> dict[str, object]:
        return {
            "asks": self._tokens_file is not None,
            "name": None if holder is None else holder.name,
            "role": None if holder is None else holder.role,
        }


def holder_in(request: Request) -> Holder | None:
    """Who asks, as the guard has found; None without tokens."""
    holder: Holder | None = request.scope.get("state", {}).get("holder")
    return holder


async def while_admitted(request: Request, stream: AsyncGenerator[bytes]) -> AsyncGenerator[bytes]:
    """A stream until its end, or until the token that opened it was revoked or has ended."""
    is_admitted = request.scope.get("state", {}).get("is_admitted")
    checked_s = time.monotonic()
    async with contextlib.aclosing(stream):
        async for data in stream:
            if is_admitted is not None and time.monotonic() - checked_s >= CHECK_S:
                checked_s = time.monotonic()
                if not is_admitted():
                    return
            yield data
