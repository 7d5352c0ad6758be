"""A pair of daemons as real processes, between lines that can be cut, and what is heard of them on the bus."""

import asyncio
import contextlib
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import psycopg
import tomli_w
from cut_line import CutLine
from shifted_clock import shift_file

from wetwell.detector.detector import Detector
from wetwell.protocols.bus.keys import sample_block_key, verdict_key
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client, open_router
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import Station
from wetwell.services.lease.table import Standing, standings
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

TICK_S = 0.1
"""From one message of samples to the next."""
KEPT_S = 60.0
PATIENCE_S = 120.0
FRESH_S = 1.0
"""A member that was seen within this time stands by. [s]"""
WATCHED_S = 2.0
"""So long is looked whether a moved clock changes anything. [s]"""
FROZEN_ON_S = 0.5
"""So long after the takeover the former owner stays as it is. [s]"""
SHIFTED_CLOCK = Path(__file__).with_name("shifted_clock.py")


@dataclass
class Heard:
    """What came of a station: when each message of samples and each verdict did. Clock of the process. [s]

    `plain` counts verdicts as a client hears them that knows nothing of numbers.
    """

    came_s: dict[int, float] = field(default_factory=dict)
    verdicts: list[tuple[float, bytes]] = field(default_factory=list)
    plain: Counter[bytes] = field(default_factory=Counter)


@dataclass
class Judged:
    """Verdicts: how many an undisturbed detector tells, and how what was heard differs.

    `plain_twice` is what a client hears twice that knows nothing of numbers; `late` when each was due and how much
    later it came, on the clock of the process. [s]
    """

    expected: int = 0
    missing: int = 0
    twice: int = 0
    otherwise: int = 0
    plain_twice: int = 0
    late: list[tuple[float, float]] = field(default_factory=list)


@dataclass
class Process:
    """One member of a pair."""

    name: str
    lines: tuple[CutLine, CutLine]
    clock: Path
    running: subprocess.Popen[bytes] | None = None


def play(endpoint: str, stations: Sequence[Station], speed: float, seed: int, orders: Connection) -> None:
    """Publish samples of all stations until told to stop; how many of each were sent is the answer."""
    plants = [Simulation(one, find_scenario("nominal"), seed + n) for n, one in enumerate(stations)]
    gather = max(1, round(speed * TICK_S))

    async def run() -> int:
        with await connect_client(endpoint) as bus:
            kept = round(KEPT_S * speed)
            publishers = [bus.publisher(sample_block_key(one.name), history=kept) for one in stations]
            sent, start_s = 0, time.monotonic()
            while not orders.poll():
                if sent < (time.monotonic() - start_s) * speed:
                    for one, plant, publisher in zip(stations, plants, publishers, strict=True):
                        block = list(plant.advance(gather, truth=False).samples(one.name))
                        numbered = [sample.model_copy(update={"seq": sent + n}) for n, sample in enumerate(block)]
                        publisher.put(SampleBlock.of(numbered).encode(), gather)
                    sent += gather
                await asyncio.sleep(TICK_S / 10.0)
            orders.send(sent)
            while orders.poll(None) and orders.recv() != "end":
                pass
        return sent

    asyncio.run(run())


class PairSite:
    """Router, player of samples and two members, of which each has its own lines to router and database."""

    def __init__(self, url: str, folder: Path, stations: Sequence[Station], speed: float, seed: int) -> None:
        self.heard = {station.name: Heard() for station in stations}
        self.members: list[Process] = []
        self.folder = folder
        self._url = url
        self._stations, self._speed, self._seed = stations, speed, seed
        self._tasks: list[asyncio.Task[None]] = []

    @contextlib.asynccontextmanager
    async def running(self, *names: str) -> AsyncIterator["PairSite"]:
        """Start all; members by their names."""
        parts = psycopg.conninfo.conninfo_to_dict(self._url)
        async with contextlib.AsyncExitStack() as stack:
            port = _free_port()
            self._endpoint = f"tcp/127.0.0.1:{port}"
            self.bus: ZenohBus = stack.enter_context(open_router(self._endpoint))
            for name in names:
                lines = (CutLine("127.0.0.1", port), CutLine(str(parts["host"]), int(str(parts["port"]))))
                for line in lines:
                    await stack.enter_async_context(line)
                self.members.append(Process(name, lines, shift_file(self.folder / f"{name}.clock")))
            stack.callback(self._end)
            self._listen()
            for member in self.members:
                self.start(member)
            await self.both_there()
            self._orders, theirs = multiprocessing.Pipe()
            words = (self._endpoint, self._stations, self._speed, self._seed, theirs)
            self._player = multiprocessing.get_context("spawn").Process(target=play, args=words)
            self._player.start()
            yield self

    def start(self, member: Process) -> None:
        """Start a member."""
        bus, database = member.lines
        url = psycopg.conninfo.make_conninfo(self._url, host="127.0.0.1", port=database.port)
        command = [sys.executable, str(SHIFTED_CLOCK), str(member.clock), *self.command()]
        environment = os.environ | {
            "WETWELL_LEASE__URL": url,
            "WETWELL_LEASE__MEMBER": member.name,
            "WETWELL_DETECTOR__CHECKPOINT_S": "5",
            "WETWELL_HEALTH__PERIOD_S": "2",
        }
        with (self.folder / f"{member.name}.log").open("ab") as log:
            member.running = subprocess.Popen(
                [*command, "--zenoh", f"tcp/127.0.0.1:{bus.port}"], stdout=log, stderr=log, env=environment
            )

    def command(self) -> list[str]:
        """Command line of the members."""
        files = [str(self.folder / f"{station.name}.toml") for station in self._stations]
        return ["detector", *(word for file in files for word in ("--station", file))]

    async def standings(self) -> Standing | None:
        """The lease as the database has it."""
        return await asyncio.to_thread(self._standing)

    def _standing(self) -> Standing | None:
        with psycopg.connect(self._url) as database:
            try:
                return next(iter(standings(database)), None)
            except psycopg.errors.UndefinedTable:
                return None

    async def owner(self) -> tuple[Process, int]:
        """The member that owns the role now, and its token."""
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            standing = await self.standings()
            if standing is not None and standing.now_s < standing.lease.expires_s:
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
        """Wait until all members have been seen just now."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                standing = await self.standings()
                fresh = [one for one in standing.members if one.age_s < FRESH_S] if standing else []
                if len({one.holder.partition("/")[0] for one in fresh}) == len(self.members):
                    return
                await asyncio.sleep(0.1)

    async def end_of_samples(self) -> None:
        """Stop the player; what it kept stays until the end."""
        self._orders.send("stop")
        await asyncio.to_thread(self._orders.poll, None)
        self.sent = int(self._orders.recv())

    def kill(self, member: Process) -> None:
        """Kill a member."""
        assert member.running is not None
        member.running.kill()
        member.running.wait()

    def signal(self, member: Process, sig: signal.Signals) -> None:
        """Send a signal to a member."""
        assert member.running is not None
        member.running.send_signal(sig)

    async def disturb(self, kind: str, shift_s: float = 3600.0) -> tuple[float, float]:
        """Let the owner have an accident, wait for its successor and undo it, until both are there again.

        Parameters
        ----------
        kind : {"kill", "freeze", "cut", "clock"}
        shift_s : float
            By which its clock is moved then. [s]

        Returns
        -------
        tuple of float
            When it happened [s, clock of this process] and how long after it the successor had the lease [s]; 0 where
            the owner stays.
        """
        owner, token = await self.owner()
        began_s = time.monotonic()
        if kind == "clock":
            shift_file(owner.clock, shift_s)
            await asyncio.sleep(WATCHED_S)
            is_same = (await self.owner())[1] == token
            return began_s, 0.0 if is_same else time.monotonic() - began_s
        undo = self._accident(kind, owner)
        await self.taken_over(token)
        taken_s = time.monotonic() - began_s
        await asyncio.sleep(FROZEN_ON_S)
        undo()
        await self.both_there()
        return began_s, taken_s

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

    def expected(self) -> dict[str, list[tuple[int, bytes]]]:
        """Verdicts of a detector that was never disturbed, by station, each with the time of its sample. [ns]"""
        found = {}
        gather = max(1, round(self._speed * TICK_S))
        for number, station in enumerate(self._stations):
            plant, detector = Simulation(station, find_scenario("nominal"), self._seed + number), Detector.of(station)
            told: list[tuple[int, bytes]] = []
            for begin in range(0, self.sent, gather):
                for place, sample in enumerate(plant.advance(gather, truth=False).samples(station.name)):
                    one = Sample.model_validate(sample.model_dump() | {"seq": begin + place})
                    told += [(one.time, verdict.encode()) for verdict in detector.update(one)]
            found[station.name] = told
        return found

    def judged(self) -> "Judged":
        """What was heard, held against what an undisturbed detector tells."""
        judged = Judged()
        for name, verdicts in self.expected().items():
            heard, wanted = self.heard[name], Counter(payload for _, payload in verdicts)
            got = Counter(payload for _, payload in heard.verdicts)
            first_s = dict[bytes, float]()
            for came_s, payload in heard.verdicts:
                first_s.setdefault(payload, came_s)
            judged.expected += len(verdicts)
            judged.missing += sum((wanted - got).values())
            judged.twice += sum(count - 1 for count in got.values())
            judged.otherwise += len(got.keys() - wanted.keys())
            judged.plain_twice += sum(count - 1 for count in heard.plain.values())
            judged.late += [
                (heard.came_s[time_ns], first_s[payload] - heard.came_s[time_ns])
                for time_ns, payload in verdicts
                if payload in first_s
            ]
        return judged

    def _listen(self) -> None:
        blocks = self.bus.subscribe(sample_block_key("*"), capacity=1_000_000)
        verdicts = self.bus.subscribe(verdict_key("*"), history=100, capacity=1_000_000)
        plain = self.bus.subscribe(verdict_key("*"), capacity=1_000_000, recover=False)

        def hear_block(payload: bytes) -> None:
            block = SampleBlock.decode(payload)
            self.heard[block.station].came_s |= dict.fromkeys(block.time, time.monotonic())

        def hear_verdict(payload: bytes) -> None:
            self.heard[Verdict.decode(payload).station].verdicts.append((time.monotonic(), payload))

        def hear_plain(payload: bytes) -> None:
            self.heard[Verdict.decode(payload).station].plain[payload] += 1

        for subscription, handle in ((blocks, hear_block), (verdicts, hear_verdict), (plain, hear_plain)):
            self._tasks.append(asyncio.create_task(_each(subscription, handle)))

    def _end(self) -> None:
        for task in self._tasks:
            task.cancel()
        for member in self.members:
            if member.running is not None and member.running.poll() is None:
                member.running.kill()
                member.running.wait()
        if self._player.pid is not None:
            with contextlib.suppress(OSError):
                self._orders.send("end")
            self._player.join(5.0)
            self._player.kill()


def stations_of(folder: Path, count: int) -> list[Station]:
    """So many stations like alpha, with their files in a folder."""
    stations = [find_station("alpha").model_copy(update={"name": f"s{number:02d}"}) for number in range(count)]
    for station in stations:
        table = station.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        (folder / f"{station.name}.toml").write_text(tomli_w.dumps(table))
    return stations


def _mend(lines: Sequence[CutLine]) -> None:
    for line in lines:
        line.mend()


async def _each(subscription: Any, handle: Any) -> None:
    while True:
        for payload in await subscription.receive():
            handle(payload)


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])
