"""The whole service on one machine: router, simulator with its PLC, detector, historian; verdicts on the terminal."""

import asyncio
import contextlib
import logging
import os
import sys
from collections.abc import AsyncIterator, Callable, Mapping, Sequence

from wetwell.protocols.bus.interface import Bus, Subscription
from wetwell.protocols.bus.keys import status_key, verdict_key
from wetwell.protocols.errors import WetwellError
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.runtime.connection import listen
from wetwell.services.runtime.health.board import BOARD, HealthBoard
from wetwell.services.runtime.lifecycle import PARENT_VARIABLE, stop_event, until
from wetwell.services.runtime.settings import Settings, environment_of

log = logging.getLogger(__name__)

STOP_TIMEOUT_S = 10.0


class ChildError(WetwellError):
    """A child process has ended by itself."""


async def serve_all(
    settings: Settings,
    station: str,
    commands: Mapping[str, Sequence[str]],
    show: Callable[[Verdict], None],
    limit_s: float | None,
    greet: Callable[[], None],
) -> None:
    """Run router and children until stopped, until the time is over, or until a child ends.

    Parameters
    ----------
    settings : Settings
        For the router here and, by the environment, for the children.
    station : str
        Name whose verdicts are shown.
    commands : dict
        Arguments of `wetwell` for each child, by name.
    show : callable
        Gets each verdict.
    limit_s : float, optional
        Time after which all is stopped. [s]
    greet : callable
        Called when the router listens and Ctrl-C is heard.

    Raises
    ------
    LinkError
        If the router's endpoint cannot be opened.
    ChildError
        If a child ends before it was asked to.
    """
    async with stop_event() as stop:
        with listen(settings) as bus:
            greet()
            running = asyncio.create_task(_run(settings, bus, station, commands, show), name="up.run")
            if limit_s is not None:
                asyncio.get_running_loop().call_later(limit_s, stop.set)
            await until(stop, running)


async def _run(
    settings: Settings, bus: Bus, station: str, commands: Mapping[str, Sequence[str]], show: Callable[[Verdict], None]
) -> None:
    verdicts = bus.subscribe(verdict_key(station))
    statuses = bus.subscribe(status_key("*", "*"))
    async with contextlib.AsyncExitStack() as stack:
        children = {
            name: await stack.enter_async_context(_child(settings, name, arguments))
            for name, arguments in commands.items()
        }
        waits = [asyncio.create_task(_watch(name, child), name=f"up.{name}") for name, child in children.items()]
        shows = [
            asyncio.create_task(_show(verdicts, show), name="up.verdicts"),
            asyncio.create_task(_show_health(statuses, BOARD, settings.health.period_s), name="up.health"),
        ]
        try:
            done, _ = await asyncio.wait([*waits, *shows], return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in (*waits, *shows):
                task.cancel()


async def _show(verdicts: Subscription[bytes], show: Callable[[Verdict], None]) -> None:
    while True:
        for payload in await verdicts.receive():
            try:
                show(Verdict.decode(payload))
            except MessageError as error:  # anybody may publish on the bus
                log.warning("%s", error)


async def _show_health(statuses: Subscription[bytes], board: HealthBoard, period_s: float) -> None:
    """Put the figures of all services behind the health page of this process."""
    while True:
        for payload in await statuses.receive():
            try:
                status = Status.decode(payload)
            except MessageError as error:
                log.warning("%s", error)
            else:
                board.report(status.station, status.service, period_s, status.figures)


async def _watch(name: str, child: asyncio.subprocess.Process) -> None:
    code = await child.wait()
    raise ChildError(f"{name} ended by itself with exit code {code}; what it said stands above")


@contextlib.asynccontextmanager
async def _child(
    settings: Settings, name: str, arguments: Sequence[str]
) -> AsyncIterator[asyncio.subprocess.Process]:
    """Start a child in a session of its own; at the end ask it to stop, and make it stop if it does not."""
    alone = settings.health.model_copy(update={"http": None})  # the page is the supervisor's
    given = environment_of(settings.model_copy(update={"health": alone}))
    environment = os.environ | given | {PARENT_VARIABLE: "1"}
    environment.pop("WETWELL_HEALTH__HTTP", None)
    child = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "wetwell.services",
        *arguments,
        stdin=asyncio.subprocess.PIPE,
        env=environment,
        start_new_session=True,
    )
    try:
        yield child
    finally:
        if child.returncode is None:
            child.terminate()
            try:
                async with asyncio.timeout(STOP_TIMEOUT_S):
                    await child.wait()
            except TimeoutError:
                log.warning("%s did not stop within %g s and is killed", name, STOP_TIMEOUT_S)
                child.kill()
                await child.wait()
