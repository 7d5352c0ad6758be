"""Samples of many stations for a pair of detectors, and their verdicts held against those of an undisturbed one."""

import asyncio
import contextlib
import multiprocessing
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import tomli_w

from wetwell.detector.detector import Detector
from wetwell.protocols.bus.interface import Subscription
from wetwell.protocols.bus.keys import sample_block_key, verdict_key
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

TICK_S = 0.1
"""From one message of samples to the next."""
KEPT_S = 60.0
PATIENCE_S = 60.0


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


class Player:
    """Plays samples of stations in a process of its own, and hears them and the verdicts on them."""

    def __init__(self, stations: Sequence[Station], speed: float, seed: int) -> None:
        self.heard = {station.name: Heard() for station in stations}
        self.sent = 0
        self._stations, self._speed, self._seed = stations, speed, seed
        self._tasks: list[asyncio.Task[None]] = []

    @contextlib.asynccontextmanager
    async def playing(self, bus: ZenohBus, endpoint: str) -> AsyncIterator["Player"]:
        """Play until the block ends; what was sent is kept by its publishers until then."""
        self._listen(bus)
        self._orders, theirs = multiprocessing.Pipe()
        words = (endpoint, self._stations, self._speed, self._seed, theirs)
        player = multiprocessing.get_context("spawn").Process(target=play, args=words)
        player.start()
        try:
            yield self
        finally:
            for task in self._tasks:
                task.cancel()
            with contextlib.suppress(OSError):
                self._orders.send("end")
            player.join(5.0)
            player.kill()

    async def end_of_samples(self) -> None:
        """Stop the player; what it kept stays until the end."""
        self._orders.send("stop")
        await asyncio.to_thread(self._orders.poll, None)
        self.sent = int(self._orders.recv())

    async def all_heard(self) -> None:
        """Wait until each station has as many verdicts as an undisturbed detector tells, or until no more come."""
        wanted = {name: len(told) for name, told in (await asyncio.to_thread(self.expected)).items()}
        end_s = time.monotonic() + PATIENCE_S
        while any(len(self.heard[name].verdicts) < count for name, count in wanted.items()):
            if time.monotonic() > end_s:
                return
            await asyncio.sleep(0.1)

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

    def judged(self) -> Judged:
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

    def _listen(self, bus: ZenohBus) -> None:
        blocks = bus.subscribe(sample_block_key("*"), capacity=1_000_000)
        verdicts = bus.subscribe(verdict_key("*"), history=100, capacity=1_000_000)
        plain = bus.subscribe(verdict_key("*"), capacity=1_000_000, recover=False)

        def hear_block(payload: bytes) -> None:
            block = SampleBlock.decode(payload)
            self.heard[block.station].came_s |= dict.fromkeys(block.time, time.monotonic())

        def hear_verdict(payload: bytes) -> None:
            self.heard[Verdict.decode(payload).station].verdicts.append((time.monotonic(), payload))

        def hear_plain(payload: bytes) -> None:
            self.heard[Verdict.decode(payload).station].plain[payload] += 1

        for subscription, handle in ((blocks, hear_block), (verdicts, hear_verdict), (plain, hear_plain)):
            self._tasks.append(asyncio.create_task(_each(subscription, handle)))


def stations_of(folder: Path, count: int) -> list[Station]:
    """So many stations like alpha, with their files in a folder."""
    stations = [find_station("alpha").model_copy(update={"name": f"s{number:02d}"}) for number in range(count)]
    for station in stations:
        table = station.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        (folder / f"{station.name}.toml").write_text(tomli_w.dumps(table))
    return stations


async def _each(subscription: Subscription[bytes], handle: Callable[[bytes], None]) -> None:
    while True:
        for payload in await subscription.receive():
            handle(payload)
