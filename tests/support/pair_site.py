"""A pair of daemons as real processes, between lines that can be cut, whose owner has accidents."""

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import psycopg
from cut_line import CutLine
from ports import free_port
from shifted_clock import shift_file

from wetwell.protocols.bus.zenoh.link import ZenohBus, open_router
from wetwell.services.lease.table import Standing, standings
from wetwell.services.runtime.settings import LeaseSettings

PATIENCE_S = 300.0
TTL_S = LeaseSettings().ttl_s
WATCHED_S = 2.0
"""So long is looked whether a moved clock changes anything. [s]"""
DOWN_S = 0.5
"""So long after the takeover the former owner stays as it is. [s]"""
SHIFTED_CLOCK = Path(__file__).with_name("shifted_clock.py")


@dataclass
class Process:
    """One member of a pair."""

    name: str
    lines: tuple[CutLine, CutLine]
    clock: Path
    running: subprocess.Popen[bytes] | None = None


class Accident(NamedTuple):
    """What an accident did to a pair.

    `began_s` is by the clock of this process; `is_double`: it met a pair that was not whole; `taken_after_s`: how
    long until the successor had the lease, 0 where the owner stays; `whole_after_s`: how long after it was undone the
    pair was whole again, where that was waited for.
    """

    began_s: float
    is_double: bool
    taken_after_s: float
    whole_after_s: float | None = None


class PairSite:
    """Router and two members, of which each has its own lines to router and database.

    Parameters
    ----------
    url : str
        Of the database.
    folder : Path
    command : sequence of str
        Command line of the members, behind `wetwell`.
    """

    def __init__(self, url: str, folder: Path, command: Sequence[str]) -> None:
        self.members: list[Process] = []
        self.folder = folder
        self._role = f"{command[0]}/{folder.name}"
        self._url = url
        self._command = command

    @contextlib.asynccontextmanager
    async def running(self, *names: str) -> AsyncIterator["PairSite"]:
        """Start all; members by their names."""
        parts = psycopg.conninfo.conninfo_to_dict(self._url)
        async with contextlib.AsyncExitStack() as stack:
            port = free_port()
            self.endpoint = f"tcp/127.0.0.1:{port}"
            self.bus: ZenohBus = stack.enter_context(open_router(self.endpoint))
            for name in names:
                lines = (CutLine("127.0.0.1", port), CutLine(str(parts["host"]), int(str(parts["port"]))))
                for line in lines:
                    await stack.enter_async_context(line)
                self.members.append(Process(name, lines, shift_file(self.folder / f"{name}.clock")))
            stack.callback(self._end)
            for member in self.members:
                self.start(member)
            await self.both_there()
            yield self

    def start(self, member: Process) -> None:
        """Start a member."""
        bus, database = member.lines
        url = psycopg.conninfo.make_conninfo(self._url, host="127.0.0.1", port=database.port)
        command = [sys.executable, str(SHIFTED_CLOCK), str(member.clock), *self._command]
        environment = os.environ | {
            "WETWELL_LEASE__URL": url,
            "WETWELL_LEASE__GROUP": self.folder.name,
            "WETWELL_HISTORIAN__URL": url,
            "WETWELL_LEASE__MEMBER": member.name,
            "WETWELL_DETECTOR__CHECKPOINT_S": "5",
            "WETWELL_HEALTH__PERIOD_S": "2",
        }
        with (self.folder / f"{member.name}.log").open("ab") as log:
            member.running = subprocess.Popen(
                [*command, "--zenoh", f"tcp/127.0.0.1:{bus.port}"], stdout=log, stderr=log, env=environment
            )

    async def standings(self) -> Standing | None:
        """The lease as the database has it."""
        return await asyncio.to_thread(self._standing)

    def _standing(self) -> Standing | None:
        with psycopg.connect(self._url) as database:
            try:
                return next((one for one in standings(database) if one.role == self._role), None)
            except psycopg.errors.UndefinedTable:
                return None

    async def owner(self) -> tuple[Process, int]:
        """The member that owns the role now, and its token."""
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            standing = await self.standings()
            if standing is not None and standing.is_owned:
                name = standing.lease.holder.partition("/")[0]
                return next(member for member in self.members if member.name == name), standing.lease.token
            await asyncio.sleep(0.05)
        raise TimeoutError(f"nobody owns the role after {PATIENCE_S:g} s")

    async def taken_over(self, token: int) -> None:
        """Wait until a later token than this one stands."""
        async with asyncio.timeout(PATIENCE_S):
            while (await self.owner())[1] <= token:  # noqa: ASYNC110 - it is seen in the database
                await asyncio.sleep(0.05)

    async def both_there(self) -> None:
        """Wait until one member owns the role, and all others stand by."""
        async with asyncio.timeout(PATIENCE_S):
            while not await self.is_whole():  # noqa: ASYNC110 - it is seen in the database
                await asyncio.sleep(0.1)

    async def is_whole(self) -> bool:
        """Whether one member owns the role, and all others show that they stand by."""
        standing = await self.standings()
        if standing is None or not standing.is_owned:
            return False
        there = [standing.lease.holder, *standing.stand_by(TTL_S)]
        return len({holder.partition("/")[0] for holder in there}) == len(self.members)

    def kill(self, member: Process) -> None:
        """Kill a member."""
        assert member.running is not None
        member.running.kill()
        member.running.wait()

    def signal(self, member: Process, sig: signal.Signals) -> None:
        """Send a signal to a member."""
        assert member.running is not None
        member.running.send_signal(sig)

    async def disturb(
        self,
        kind: str,
        shift_s: float = 3600.0,
        *,
        down_s: float = DOWN_S,
        is_undone: bool = True,
        waits: bool = True,
    ) -> Accident:
        """Let the owner have an accident, wait for its successor and undo it, until both are there again.

        Parameters
        ----------
        kind : {"kill", "freeze", "cut", "clock"}
        shift_s : float
            By which its clock is moved then. [s]
        down_s : float
            So long after the takeover it is undone. [s]
        is_undone, waits : bool
            Whether it is undone at all, and whether to wait then until the pair is whole.
        """
        is_double = not await self.is_whole()
        owner, token = await self.owner()
        began_s = time.monotonic()
        if kind == "clock":
            shift_file(owner.clock, shift_s)
            await asyncio.sleep(WATCHED_S)
            is_same = (await self.owner())[1] == token
            return Accident(began_s, is_double, 0.0 if is_same else time.monotonic() - began_s)
        undo = self._accident(kind, owner)
        await self.taken_over(token)
        taken_s = time.monotonic() - began_s
        await asyncio.sleep(down_s)
        whole_s = None
        if is_undone:
            undo()
            undone_s = time.monotonic()
            if waits:
                await self.both_there()
                whole_s = time.monotonic() - undone_s
        return Accident(began_s, is_double, taken_s, whole_s)

    def _accident(self, kind: str, owner: Process) -> Callable[[], None]:
        if kind == "kill":
            self.kill(owner)
            return lambda: self.start(owner)
        if kind == "freeze":
            self.signal(owner, signal.SIGSTOP)
            return lambda: self.signal(owner, signal.SIGCONT)
        for line in owner.lines:
            line.cut()
        return lambda: _mend(owner.lines)

    def _end(self) -> None:
        for member in self.members:
            if member.running is not None and member.running.poll() is None:
                member.running.kill()
                member.running.wait()


def _mend(lines: Sequence[CutLine]) -> None:
    for line in lines:
        line.mend()
