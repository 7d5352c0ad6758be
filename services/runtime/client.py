"""What every client of a daemon does: connect, ask until there is an answer, and give up in time."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.errors import LinkError
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.settings import Settings

T = TypeVar("T")

RETRY_S = 0.1


async def ask_service(
    settings: Settings, question: Callable[[Bus], Awaitable[T]], silence: str, within_s: float
) -> T:
    """Answer to a question on the bus of the settings.

    Raises
    ------
    LinkError
        If nobody answers in time; `silence` says who did not.
    """
    try:
        async with asyncio.timeout(within_s):
            with await connect(settings) as bus:
                return await question(bus)
    except TimeoutError as error:
        raise LinkError(f"{silence} answered on {settings.zenoh.endpoint} within {within_s:g} s") from error


async def first_answer(bus: Bus, key: str, payload: bytes = b"", *, timeout_s: float) -> bytes:
    """First answer on a key; asks again until there is one."""
    while True:
        for answer in await bus.ask(key, payload, timeout_s=timeout_s):
            return answer
        await asyncio.sleep(RETRY_S)
