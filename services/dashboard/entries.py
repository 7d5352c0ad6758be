"""Who comes in to the page, who is refused, and what the page orders: written into the audit."""

import asyncio
import time
from pathlib import Path

from starlette.types import Scope

from wetwell.protocols.errors import RecordingError
from wetwell.services.dashboard.refusal import RefusalError
from wetwell.services.runtime.clock import now_ns
from wetwell.services.security.attempts import Attempts, is_news
from wetwell.services.security.audit import Audit
from wetwell.services.security.tokens import Holder, standing_of


class Entries:
    """Logins, refusals and orders of the page, each a line of the audit; the disk has a thread of its own.

    Nobody is kept out because the disk refuses, and a stranger cannot fill it: of an address, and of a viewer who
    tries to act, one more refusal is written in six seconds, after the first ten.

    Parameters
    ----------
    audit : Audit
    tokens_file : Path, optional
        File of tokens, which also tells of those that have ended or were revoked.
    """

    def __init__(self, audit: Audit, tokens_file: Path | None) -> None:
        self._audit = audit
        self._tokens_file = tokens_file
        self._wrong = Attempts()
        self._forbidden = Attempts()

    async def enter(self, holder: Holder, scope: Scope) -> None:
        """Note that somebody has come in."""
        await self._note(act="login", by=holder.name, role=holder.role, address=address_of(scope))

    async def leave(self, holder: Holder, scope: Scope) -> None:
        """Note that somebody has gone."""
        await self._note(act="logout", by=holder.name, address=address_of(scope))

    async def refuse(self, token: str, scope: Scope) -> tuple[int, str] | None:
        """Count and note a wrong token; the refusal where there were too many of its address."""
        address = address_of(scope)
        wait_s = self._wrong.note(address, time.monotonic())
        if is_news(wait_s):
            standing = {} if self._tokens_file is None else standing_of(self._tokens_file, token)
            reason = {"refused": "too many wrong tokens"} if wait_s else {"refused": "wrong token"} | standing
            await self._note(act="login", address=address, path=scope["path"], **reason)
        return (429, f"too many wrong tokens from {address}: wait {wait_s:.0f} s") if wait_s else None

    async def forbid(self, holder: Holder, scope: Scope) -> None:
        """Note that somebody wanted to do what his role does not allow."""
        if is_news(self._forbidden.note(holder.name, time.monotonic())):
            address, path = address_of(scope), scope["path"]
            await self._note(act="request", by=holder.name, address=address, path=path, refused="may look, not act")

    async def order(self, holder: Holder | None, scope: Scope, **fields: object) -> None:
        """Write an order of the page down, before it is sent.

        Raises
        ------
        RefusalError
            If it cannot be written.
        """
        by = None if holder is None else holder.name
        try:
            await asyncio.to_thread(self._audit.write, now_ns(), by=by, address=address_of(scope), **fields)
        except RecordingError as error:
            raise RefusalError(503, "the audit cannot be written, so nothing was done") from error

    async def _note(self, **fields: object) -> None:
        await asyncio.to_thread(self._audit.note, now_ns(), **fields)


def address_of(scope: Scope) -> str:
    """Address from which a request comes."""
    return str((scope.get("client") or ("?", 0))[0])
