"""Who looks at the page: a token once, then a cookie that scripts cannot read."""

import json
from pathlib import Path

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from wetwell.services.dashboard.guard import COOKIE
from wetwell.services.security.tokens import Holder, holder_of

COOKIE_S = 30 * 24 * 3600


class Login:
    """Answers on who asks; without a file of tokens nobody needs one."""

    def __init__(self, tokens_file: Path | None) -> None:
        self._tokens_file = tokens_file

    async def who(self, request: Request) -> Response:
        """Whether a token is needed, and who has brought one."""
        return JSONResponse(self._told(holder_in(request)), headers={"cache-control": "no-store"})

    async def enter(self, request: Request) -> Response:
        """Take {"token"}; a right one comes back as a cookie, an empty one takes the cookie away."""
        try:
            token = str(json.loads(await request.body())["token"])
        except (ValueError, KeyError, TypeError):
            return JSONResponse({"error": "token: must be given"}, 400)
        holder = None if self._tokens_file is None else holder_of(self._tokens_file, token)
        answer = JSONResponse(self._told(holder), headers={"cache-control": "no-store"})
        if holder is None:
            answer.delete_cookie(COOKIE)
        else:
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
