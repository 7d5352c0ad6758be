"""A TCP line that can be cut: then it carries nothing either way, and says nothing of it, until it is mended."""

import asyncio
import contextlib
from typing import Self

AT_ONCE = 65_536


class CutLine:
    """Stands between a member of a pair and a server.

    Parameters
    ----------
    host, port
        Of the server.
    """

    def __init__(self, host: str, port: int) -> None:
        self.port = 0
        self._there = host, port
        self._is_whole = asyncio.Event()
        self._is_whole.set()
        self._server: asyncio.Server | None = None

    def cut(self) -> None:
        """Carry nothing more: neither what is sent, nor that a connection ends."""
        self._is_whole.clear()

    def mend(self) -> None:
        """Carry again, also what was sent meanwhile."""
        self._is_whole.set()

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._carry, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._server is not None:
            self._server.close()

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.closing(writer), contextlib.suppress(OSError, asyncio.CancelledError):
            await self._is_whole.wait()
            back_reader, back_writer = await asyncio.open_connection(*self._there)
            with contextlib.closing(back_writer):
                ways = [self._way(reader, back_writer), self._way(back_reader, writer)]
                tasks = [asyncio.create_task(way) for way in ways]
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    async def _way(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(AT_ONCE):
            await self._is_whole.wait()
            writer.write(data)
            await writer.drain()
        await self._is_whole.wait()
