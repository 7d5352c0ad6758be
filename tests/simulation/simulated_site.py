"""A whole site on a virtual clock: PLCs, gateway, bus, detector, and what befalls them, all from one seed."""

import asyncio
import random
from collections.abc import Callable, Coroutine, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from network import Network, SimulatedBus

from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.protocols.keys import sample_key, verdict_key
from wetwell.protocols.messages import Sample, Verdict
from wetwell.protocols.recording import Recording
from wetwell.protocols.station import Station
from wetwell.services.detector.serve import judge_all, judge_of
from wetwell.services.settings import DetectorSettings, Settings
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HISTORY = 600


@dataclass
class Process:
    """A daemon that can die and come back."""

    name: str
    work: Callable[[SimulatedBus], Coroutine[Any, Any, None]]
    bus: SimulatedBus | None = None
    task: asyncio.Task[None] | None = None

    def start(self, network: Network) -> None:
        """Begin, with a connection of its own."""
        self.bus = network.join(self.name)
        self.task = asyncio.create_task(self.work(self.bus), name=self.name)

    async def kill(self) -> None:
        """End it as SIGKILL does: nothing is sent or saved any more."""
        assert self.bus is not None
        assert self.task is not None
        self.bus.kill()
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


@dataclass
class Site:
    """Stations whose samples come every `period_s` of virtual time, and the daemons that deal with them."""

    seed: int
    stations: Sequence[Station]
    scenario: Scenario
    seconds: int
    period_s: int
    folder: Path
    published: dict[str, list[Sample]] = field(default_factory=dict)
    told: dict[str, dict[tuple[int, int, bytes], Verdict]] = field(default_factory=dict)
    kills: int = 0

    def __post_init__(self) -> None:
        self.dice = random.Random(self.seed)
        self.network = Network(self.dice)
        self.settings = Settings(detector=DetectorSettings(state_dir=self.folder / "detector", checkpoint_s=600.0))
        self.detector = Process("detector", self._detect)

    async def live(self) -> None:
        """Let the site live from the first to the last sample, with its accidents, and become quiet."""
        observer = asyncio.create_task(self._observe(self.network.join("observer")), name="observer")
        self.detector.start(self.network)
        accidents = asyncio.create_task(self._accidents(), name="accidents")
        await self._poll(self.network.join("gateway"))
        accidents.cancel()
        await asyncio.gather(accidents, return_exceptions=True)
        await asyncio.sleep(600.0)
        await self.detector.kill()
        observer.cancel()
        await asyncio.gather(observer, return_exceptions=True)

    async def _poll(self, bus: SimulatedBus) -> None:
        feeds = [self._feed(number, station) for number, station in enumerate(self.stations)]
        publishers = [bus.publisher(sample_key(station.name), history=HISTORY) for station in self.stations]
        for samples in zip(*feeds, strict=True):
            for sample, publisher in zip(samples, publishers, strict=True):
                self.published.setdefault(sample.station, []).append(sample)
                publisher.put(sample.encode())
            await asyncio.sleep(self.period_s)

    def _feed(self, number: int, station: Station) -> Iterator[Sample]:
        """What a poll every `period_s` sees of a station."""
        recording = Simulation(station, self.scenario, self.seed * 1000 + number).advance(self.seconds, truth=False)
        seen = Recording(
            time_ns=recording.time_ns[:: self.period_s],
            columns={name: column[:: self.period_s] for name, column in recording.columns.items()},
        )
        return seen.samples(station.name)

    async def _detect(self, bus: SimulatedBus) -> None:
        await judge_all(self.settings, bus, [judge_of(self.settings, bus, station) for station in self.stations])

    async def _observe(self, bus: SimulatedBus) -> None:
        verdicts = bus.subscribe(verdict_key("*"), capacity=1_000_000)
        while True:
            for payload in await verdicts.receive():
                verdict = Verdict.decode(payload)
                heard = self.told.setdefault(verdict.station, {})
                heard.setdefault((verdict.time, verdict.pump, payload), verdict)

    async def _accidents(self) -> None:
        """What befalls a site, a few times a day."""
        while True:
            await asyncio.sleep(self.dice.expovariate(1.0 / 10_000.0))
            match self.dice.choice(["kill detector", "cut detector"]):
                case "kill detector":
                    self.kills += 1
                    await self.detector.kill()
                    await asyncio.sleep(self.dice.uniform(0.0, 1_000.0))
                    self.detector.start(self.network)
                case "cut detector":
                    assert self.detector.bus is not None
                    self.detector.bus.cut(self.dice.uniform(1.0, 300.0))


def undisturbed(station: Station, samples: Sequence[Sample]) -> list[Verdict]:
    """Verdicts of a detector that gets each sample once, in order."""
    detector = Detector(station.name, nominal_of(station))
    return [verdict for sample in samples for verdict in detector.update(sample)]
