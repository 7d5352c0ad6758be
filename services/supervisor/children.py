"""Children of the supervisor: each a command of `wetwell` in a process of its own."""

import asyncio
import contextlib
import logging
import os
import re
import sys
from collections.abc import AsyncIterator, Sequence

from wetwell.protocols.errors import WetwellError
from wetwell.services.runtime.lifecycle import PARENT_VARIABLE
from wetwell.services.runtime.settings import Settings, environment_of

log = logging.getLogger(__name__)

STOP_TIMEOUT_S = 10.0
ONE_SETTING = r"WETWELL_\w+?__"
"""Variables of single settings: they would count for more than the sections, in which flags have their say."""


class ChildError(WetwellError):
    """A child process has ended by itself."""


@contextlib.asynccontextmanager
async def child(settings: Settings, name: str, arguments: Sequence[str]) -> AsyncIterator[asyncio.subprocess.Process]:
    """Start a child in a session of its own; at the end ask it to stop, and make it stop if it does not."""
    alone = settings.health.model_copy(update={"http": None})  # the page is the supervisor's
    given = environment_of(settings.model_copy(update={"health": alone}))
    inherited = {name: value for name, value in os.environ.items() if not re.match(ONE_SETTING, name)}
    environment = inherited | given | {PARENT_VARIABLE: "1"}
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "wetwell.services",
        *arguments,
        stdin=asyncio.subprocess.PIPE,
        env=environment,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.terminate()
            try:
                async with asyncio.timeout(STOP_TIMEOUT_S):
                    await process.wait()
            except TimeoutError:
                log.warning("%s did not stop within %g s and is killed", name, STOP_TIMEOUT_S)
                process.kill()
                await process.wait()


async def watch(name: str, process: asyncio.subprocess.Process) -> None:
    """Wait for the end of a child, which nobody wants.

    Raises
    ------
    ChildError
        When it comes.
    """
    code = await process.wait()
    raise ChildError(f"{name} ended by itself with exit code {code}; what it said stands above")
