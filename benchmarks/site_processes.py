"""Daemons as processes, what is heard of them on the bus, and what they use."""

import asyncio
import contextlib
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from wetwell.protocols.bus.keys import SITE, status_key, verdict_key
from wetwell.protocols.bus.zenoh.link import ZenohBus
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.runtime.lifecycle import PARENT_VARIABLE

PATIENCE_S = 1_200.0
LOOK_S = 0.001
"""So often the benchmark looks for verdicts, so that it measures the site and not itself. [s]"""
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


@contextlib.contextmanager
def started(
    commands: Mapping[str, Sequence[str]], endpoint: str, **settings: Mapping[str, object]
) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Daemons by their names, with their command lines behind `wetwell`; at the end they are asked to stop."""
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, words in commands.items():
            running[name] = daemon(words, endpoint, settings)
        yield running
    finally:
        for process in reversed(running.values()):
            process.terminate()
            process.wait()


def daemon(
    words: Sequence[str], endpoint: str, settings: Mapping[str, Mapping[str, object]]
) -> subprocess.Popen[bytes]:
    """A daemon of ours."""
    given = {f"WETWELL_{name.upper()}": json.dumps(table) for name, table in settings.items()}
    environment = os.environ | given | {PARENT_VARIABLE: "1", "WETWELL_LOG": json.dumps({"level": "ERROR"})}
    command = [sys.executable, "-m", "wetwell.services", *words, "--zenoh", endpoint]
    return subprocess.Popen(command, env=environment, stdin=subprocess.PIPE)  # noqa: S603 - our own commands


def free_endpoint() -> str:
    """Where a router of ours may listen."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"


def cpu_and_memory(pid: int) -> tuple[float, float]:
    """CPU time and resident memory of a process. [s, MB]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS, pages * PAGE_BYTES / 1e6


class Site:
    """What is heard of a site, and what its processes use."""

    def __init__(self, bus: ZenohBus, pids: dict[str, int]) -> None:
        self.arrivals: list[tuple[float, Verdict]] = []
        self.figures: dict[tuple[str, str], dict[str, float]] = {}
        self.curve: list[dict[str, float]] = []
        self.router_killed_s: float | None = None
        self.pids = pids
        self._verdicts = bus.subscribe(verdict_key("*"), capacity=1_000_000, pace_s=LOOK_S)
        self._statuses = bus.subscribe(status_key("*", "*"), history=1, capacity=1_000_000)

    async def hear_verdicts(self) -> None:
        """Keep verdicts and when they came, for ever."""
        while True:
            payloads = await self._verdicts.receive()
            now_s = time.monotonic()
            self.arrivals += [(now_s, Verdict.decode(payload)) for payload in payloads]

    async def hear_statuses(self) -> None:
        """Keep the last health figures of each service, for ever."""
        while True:
            for payload in await self._statuses.receive():
                with contextlib.suppress(MessageError):  # a router that cannot keep up has brought one on another key
                    status = Status.decode(payload)
                    self.figures[status.station, status.service] = status.figures

    async def wait_for(self, stations: int, services: int = 0) -> None:
        """Until so many stations have their judge, and so many services of the site have shown themselves."""
        async with asyncio.timeout(PATIENCE_S):
            while len(self.judged) < stations or self._services() < services:  # noqa: ASYNC110 - seen on the bus
                await asyncio.sleep(0.1)

    @property
    def judged(self) -> dict[str, float]:
        """Samples that each station's judge has had in all its life."""
        return {
            station: figures.get("samples", 0.0)
            for (station, service), figures in self.figures.items()
            if service == "detector"
        }

    def _services(self) -> int:
        return sum(station == SITE for station, _ in self.figures)

    async def look(self, period_s: float) -> None:
        """Note what the processes use, for ever."""
        while True:
            self.look_once()
            await asyncio.sleep(period_s)

    def look_once(self) -> None:
        """Note what the processes use."""
        point = {"time_s": time.monotonic(), "load": os.getloadavg()[0]}
        for name, pid in self.pids.items():
            point[f"{name}_cpu_s"], point[f"{name}_mb"] = cpu_and_memory(pid)
        self.curve.append(point)

    def summed(self, service: str) -> dict[str, float]:
        """Health figures of a service over all stations."""
        total: dict[str, float] = {}
        for (_, each), figures in self.figures.items():
            if each == service:
                for name, value in figures.items():
                    total[name] = total.get(name, 0.0) + value
        return total
