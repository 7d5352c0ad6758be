"""Real routers on several loopback addresses, in a tree and in a ring, through accidents.

The tree, with judges behind its branches:

  publishers, reader
          |
root 127.0.0.1 <-- link that can be cut -- left 127.0.0.2 <-- judge of north
          ^------------------------------- right 127.0.0.3 <-- judges of south and east
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from functools import partial

import pytest
from routers import Router, free_address

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.bus.interface import Subscription
from wetwell.protocols.bus.keys import sample_key, verdict_key
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.detector.intake import Intake
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.runtime.sample_sender import LEAST_KEPT
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

pytestmark = pytest.mark.check

LIMIT_S = 60.0
PART = 300
"""Samples between two looks; fewer than publishers keep."""
PARTS = 12

assert PART < LEAST_KEPT


class Cable:
    """TCP from an address of its own to another; it can be cut, which ends its connections, and frozen."""

    def __init__(self, target: str) -> None:
        self.address = free_address("127.0.0.2")
        self._target = target
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._flows = asyncio.Event()
        self._flows.set()

    async def heal(self) -> None:
        host, _, port = self.address.partition(":")
        self._server = await asyncio.start_server(self._serve, host, int(port))

    async def join(self) -> None:
        """Heal, and wait until somebody is connected through it again."""
        await self.heal()
        async with asyncio.timeout(LIMIT_S):
            while len(self._writers) < 2:  # noqa: ASYNC110
                await asyncio.sleep(0.01)

    async def cut(self) -> None:
        self._server.close()
        while self._tasks:  # one more may have been accepted a moment ago
            for writer in self._writers:
                writer.transport.abort()
            await asyncio.wait(self._tasks, timeout=0.1)

    async def flap(self) -> None:
        """Heal for as long as it takes to see that something is missing, not to get it; then again for good."""
        await self.heal()
        await asyncio.sleep(0.3)
        await self.cut()
        await asyncio.sleep(4.0)
        await self.heal()

    async def freeze(self) -> None:
        self._flows.clear()

    async def thaw(self) -> None:
        self._flows.set()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if not self._server.is_serving():
            writer.transport.abort()
            return
        task = asyncio.create_task(self._join(reader, writer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _join(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        host, _, port = self._target.partition(":")
        try:
            far_reader, far_writer = await asyncio.open_connection(host, int(port))
        except OSError:
            writer.transport.abort()
            self._writers.discard(writer)
            return
        self._writers.add(far_writer)
        await asyncio.gather(self._pump(reader, far_writer), self._pump(far_reader, writer))
        self._writers -= {writer, far_writer}

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(65536):
                await self._flows.wait()
                writer.write(data)
                await writer.drain()
        writer.transport.abort()


@contextlib.asynccontextmanager
async def judged(endpoint: str, station) -> AsyncIterator[StationDetector]:
    """A judge behind a router."""
    with await connect_client(f"tcp/{endpoint}") as bus:
        judge = StationDetector(bus, station)
        running = asyncio.create_task(Intake(bus, [judge]).run())
        try:
            yield judge
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)


async def caught_up(judges: list[StationDetector], last_ns: int, limit_s: float = LIMIT_S) -> bool:
    """Whether all judges have a sample in time."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(limit_s):
            while any(judge.detector.seen_until_ns < last_ns for judge in judges):  # noqa: ASYNC110
                await asyncio.sleep(0.01)
    return all(judge.detector.seen_until_ns >= last_ns for judge in judges)


async def killed(router: Router) -> None:
    router.kill()


async def replaced(router: Router) -> None:
    router.start()


Verdicts = dict[str, set[bytes]]


async def collect(verdicts: Subscription[bytes], got: Verdicts, wanted: Verdicts) -> None:
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(LIMIT_S):
            while any(wanted[name] - got[name] for name in wanted):
                for payload in await verdicts.receive():
                    got[Verdict.decode(payload).station].add(payload)


async def through_accidents(stations, samples: dict[str, list[Sample]]) -> tuple[Verdicts, Verdicts]:
    """Verdicts that a reader at the root has whatever happened on the way, and those of undisturbed detectors."""
    got: Verdicts = {name: set() for name in samples}
    async with contextlib.AsyncExitStack() as stack:
        root = Router("127.0.0.1")
        stack.callback(root.kill)
        cable = Cable(root.address)
        await cable.heal()
        stack.push_async_callback(cable.cut)
        left, right = Router("127.0.0.2", cable.address), Router("127.0.0.3", root.address)
        stack.callback(left.kill)
        stack.callback(right.kill)
        accidents = {
            2: (partial(killed, right), partial(replaced, right)),
            4: (cable.cut, cable.heal),
            6: (partial(killed, root), partial(replaced, root)),
            8: (cable.freeze, cable.thaw),
            10: (cable.cut, cable.flap),
        }
        bus: ZenohBus = stack.enter_context(await connect_client(f"tcp/{root.address}"))
        verdicts = bus.subscribe(verdict_key("*"), history=100, capacity=100_000)
        publishers = {name: bus.publisher(sample_key(name), history=LEAST_KEPT) for name in samples}
        places = dict(zip(samples, (left, right, right), strict=True))
        judges = [await stack.enter_async_context(judged(places[name].address, stations[name])) for name in samples]
        sent = 0

        def send(number: int) -> int:
            for name, publisher in publishers.items():
                for sample in samples[name][sent : sent + number]:
                    publisher.put(sample.encode())
            return samples["north"][sent + number - 1].time

        last_ns = samples["north"][0].time  # first one by one, as a site begins: until the tree stands
        while not sent or not await caught_up(judges, last_ns, limit_s=0.3):
            last_ns = send(1)
            sent += 1
        for part in range(PARTS):
            strike, mend = accidents.get(part, (None, None))
            if strike is not None:
                await strike()
            last_ns = send(PART)
            sent += PART
            if mend is not None:
                await asyncio.sleep(0.5)  # what is sent meanwhile meets nobody
                await mend()
            assert await caught_up(judges, last_ns), f"part {part}: {[judge.figures() for judge in judges]}"
        sent_samples = {name: samples[name][:sent] for name in samples}
        wanted = {name: undisturbed(stations[name], sent_samples[name]) for name in samples}
        await collect(verdicts, got, wanted)
        taken = [int(judge.figures()["samples"]) for judge in judges]
        assert taken == [sent] * len(samples)  # none is lost, none is judged twice
    return got, wanted


def undisturbed(station, samples: list[Sample]) -> set[bytes]:
    detector = Detector(station.name, datasheet_of(station))
    return {verdict.encode() for sample in samples for verdict in detector.update(sample)}


def test_verdicts_behind_a_tree_of_routers_are_those_of_an_undisturbed_detector(alpha):
    stations = {name: alpha.model_copy(update={"name": name}) for name in ("north", "south", "east")}
    samples = {
        name: list(Simulation(station, Scenario(name="plain"), seed).advance(2 * PART * PARTS).samples(name))
        for seed, (name, station) in enumerate(stations.items(), 1)
    }
    got, wanted = asyncio.run(through_accidents(stations, samples))
    assert got == wanted
    assert all(got.values())


async def numbers_through_a_ring() -> list[tuple[str, list[int], int]]:
    """What a reader has after each accident, and how many messages were sent until then."""
    found: list[tuple[str, list[int], int]] = []
    async with contextlib.AsyncExitStack() as stack:
        first = Router("127.0.0.1")
        stack.callback(first.kill)
        second = Router("127.0.0.2", first.address)
        stack.callback(second.kill)
        cable = Cable(second.address)
        await cable.heal()
        stack.push_async_callback(cable.cut)
        third = Router("127.0.0.3", first.address, cable.address)
        stack.callback(third.kill)
        publisher = stack.enter_context(await connect_client(f"tcp/{second.address}")).publisher("ring", history=600)
        reader = stack.enter_context(await connect_client(f"tcp/{third.address}")).subscribe("ring", history=600)
        got: list[int] = []
        sent = 0

        async def send(number: int, limit_s: float) -> None:
            nonlocal sent
            for _ in range(number):
                publisher.put(b"%d" % sent)
                sent += 1
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(limit_s):
                    while len(got) < sent:
                        got.extend(map(int, await reader.receive()))

        async with asyncio.timeout(LIMIT_S):
            while not got or len(got) < sent:
                await send(1, limit_s=0.3)
        for name, strike in (
            ("link cut", cable.cut),
            ("link back", cable.join),
            ("router dead", partial(killed, first)),
            ("router back", partial(replaced, first)),
            ("link cut again", cable.cut),  # now the way leads over the router that has come back
        ):
            await strike()
            await send(PART, LIMIT_S)
            found.append((name, list(got), sent))
        await cable.heal()
    return found


def test_a_ring_of_routers_goes_on_without_one_of_its_links_and_one_of_its_routers():
    for name, got, sent in asyncio.run(numbers_through_a_ring()):
        assert got == list(range(sent)), name
