"""Looks of daemons at what they hold: nobody wakes for one that cannot show anything new."""

import asyncio
import contextvars
import math
from dataclasses import dataclass, field


@dataclass(eq=False)
class _Wait:
    """Who waits since when for its next look, and how long between two; what it does then is done by its process."""

    begin_s: float
    period_s: float
    woken: asyncio.Future[None]
    context: contextvars.Context = field(default_factory=contextvars.copy_context)


class Looks:
    """Waits between two looks, in which nothing can be seen before somebody says so.

    A wait ends when one of its full periods does, as if there had been a look after each of them before.
    """

    def __init__(self) -> None:
        self._waits: dict[_Wait, None] = {}

    async def sleep(self, period_s: float) -> None:
        """Wait for the next look that may show something."""
        loop = asyncio.get_running_loop()
        wait = _Wait(loop.time(), period_s, loop.create_future())
        self._waits[wait] = None
        try:
            await wait.woken
        finally:
            del self._waits[wait]

    def matter(self) -> None:
        """Let all have their next look, as something may show."""
        loop = asyncio.get_running_loop()
        for wait in self._waits:
            periods = max(1, math.ceil((loop.time() - wait.begin_s) / wait.period_s))
            loop.call_at(wait.begin_s + periods * wait.period_s, _wake, wait.woken, context=wait.context)


def _wake(woken: asyncio.Future[None]) -> None:
    if not woken.done():
        woken.set_result(None)
