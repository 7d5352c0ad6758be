"""Keys of the terminal as they are pressed, without Enter; the terminal is as before at the end."""

import asyncio
import contextlib
import os
import sys
import termios
import tty
from collections.abc import AsyncIterator


@contextlib.asynccontextmanager
async def keyboard() -> AsyncIterator[asyncio.Queue[str] | None]:
    """Yield the keys that are pressed; None where nobody sits at a terminal. Ctrl-C stays what it is."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        yield None
        return
    loop, keys, file = asyncio.get_running_loop(), asyncio.Queue[str](), sys.stdin.fileno()
    before = termios.tcgetattr(file)

    def read() -> None:
        pressed = os.read(file, 64)
        if not pressed:  # the terminal has gone
            loop.remove_reader(file)
        for key in pressed.decode(errors="replace"):
            keys.put_nowait(key)

    tty.setcbreak(file)
    loop.add_reader(file, read)
    try:
        yield keys
    finally:
        loop.remove_reader(file)
        termios.tcsetattr(file, termios.TCSADRAIN, before)
