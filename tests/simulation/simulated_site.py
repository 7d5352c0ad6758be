"""A whole site on a virtual clock: PLCs, gateway, bus, detector, historian, alarms; what befalls them, by one seed.

The daemons are the real ones, without their processes: the coroutine that each runs on its bus. What is simulated is
the network, the PLCs, the clock, and that disks are full.
"""

import asyncio
import contextlib
import random
from collections.abc import Callable, Coroutine, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

from accidents import happen
from network import Network, SimulatedBus
from simulated_plc import SimulatedPlc

from wetwell.protocols import atomic_file
from wetwell.protocols.bus.interface import Keyed
from wetwell.protocols.bus.keys import alarm_key, sample_key, verdict_key
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.alarms import daemon as alarms_daemon
from wetwell.services.alarms.service import AlarmService
from wetwell.services.detector.daemon import judge_all
from wetwell.services.gateway import daemon as gateway_daemon
from wetwell.services.historian import daemon as historian_daemon
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import Batch, StoreError
from wetwell.services.runtime.settings import AlarmSettings, DetectorSettings, HealthSettings, Settings
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

START_NS = 1_735_689_600 * NS_PER_S
QUIET_S = 1_800.0
"""Virtual time after the last sample in which everything may settle."""


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
        """End it as SIGKILL does: nothing is sent or saved any more. An error of its own is raised."""
        assert self.bus is not None
        assert self.task is not None
        self.bus.kill()
        self.task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await self.task


@dataclass
class Site:
    """Stations that are polled every `period_s` of virtual time, and the daemons that deal with them.

    Attributes
    ----------
    published : dict
        Samples that the gateway has published, by their key, in order, repeats left out.
    told : dict
        Verdicts that were heard, by station, each payload once.
    alarms : dict
        Alarms that were heard, by station and id, in order, repeats left out.
    accidents : list of str
        What has happened, in order.
    """

    seed: int
    stations: Sequence[Station]
    scenario: Scenario
    seconds: int
    period_s: int
    folder: Path
    published: dict[str, list[bytes]] = field(default_factory=dict)
    told: dict[str, dict[bytes, Verdict]] = field(default_factory=dict)
    alarms: dict[tuple[str, str], list[Alarm]] = field(default_factory=dict)
    accidents: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.dice = random.Random(self.seed)
        self.network = Network(self.dice)
        self.is_disk_full = False
        self.clock_s = 0.0
        self.settings = Settings(
            health=HealthSettings(period_s=60.0 * self.period_s),
            detector=DetectorSettings(state_dir=self.folder / "detector", checkpoint_s=60.0 * self.period_s),
            alarms=AlarmSettings(
                state_dir=self.folder / "alarms", stale_after_s=5.0 * self.period_s, silent_after_s=600.0
            ),
        )
        self.plcs = {
            station.name: SimulatedPlc(station.name, self._feed(number, station), self.period_s, self.dice)
            for number, station in enumerate(self.stations)
        }
        self.processes = {
            "gateway": Process("gateway", self._poll),
            "detector": Process("detector", self._detect),
            "historian": Process("historian", self._keep),
            "alarms": Process("alarms", self._alarm),
        }

    async def live(self) -> None:
        """Let the site live from the first to the last sample, with its accidents, and become quiet."""
        with self._simulated_world():
            observer = Process("observer", self._observe)
            observer.start(self.network)
            for process in self.processes.values():
                process.start(self.network)
            async with asyncio.TaskGroup() as group:
                group.create_task(asyncio.sleep(self.seconds - 0.5 * self.period_s))
                group.create_task(happen(self), name="accidents")
            await self.processes["gateway"].kill()
            await asyncio.sleep(QUIET_S)
            for name in ("detector", "alarms", "historian"):
                await self.processes[name].kill()
            await observer.kill()

    def kept(self) -> FolderStore:
        """What the historian has kept."""
        return FolderStore(self.folder / "history", keep_live_days=1)

    def _feed(self, number: int, station: Station) -> Recording:
        recording = Simulation(station, self.scenario, self.seed * 1000 + number).advance(self.seconds, truth=False)
        return Recording(
            time_ns=recording.time_ns[:: self.period_s],
            columns={name: column[:: self.period_s] for name, column in recording.columns.items()},
        )

    async def _poll(self, bus: SimulatedBus) -> None:
        plcs = [simulated.plc for simulated in self.plcs.values()]
        await gateway_daemon.poll_all(bus, plcs, health_s=60.0 * self.period_s, longest_wait_s=30.0)

    async def _detect(self, bus: SimulatedBus) -> None:
        await judge_all(self.settings, bus, self.stations, "detector")

    async def _keep(self, bus: SimulatedBus) -> None:
        store = self.kept()
        historian = Historian(store)
        try:
            await historian_daemon.keep(
                bus, historian, commit_s=2.0 * self.period_s, maintain_s=3_600.0, health_s=60.0 * self.period_s
            )
        finally:
            store.close()

    async def _alarm(self, bus: SimulatedBus) -> None:
        service = AlarmService(bus, self.settings.alarms, self.stations, alarms_daemon.clocks)
        await alarms_daemon.keep(bus, service, health_period_s=60.0 * self.period_s)

    async def _observe(self, bus: SimulatedBus) -> None:
        samples = bus.collect([sample_key(station.name) for station in self.stations], capacity=1_000_000)
        verdicts = bus.subscribe(verdict_key("*"), capacity=1_000_000)
        alarms = bus.subscribe(alarm_key("*"), capacity=1_000_000)
        async with asyncio.TaskGroup() as group:
            group.create_task(_each(samples, self._note_sample))
            group.create_task(_each(verdicts, self._note_verdict))
            group.create_task(_each(alarms, self._note_alarm))

    def _note_sample(self, sample: Keyed) -> None:
        key, payload = sample
        heard = self.published.setdefault(key, [])
        if not heard or heard[-1] != payload:
            heard.append(payload)

    def _note_verdict(self, payload: bytes) -> None:
        verdict = Verdict.decode(payload)
        self.told.setdefault(verdict.station, {}).setdefault(payload, verdict)

    def _note_alarm(self, payload: bytes) -> None:
        alarm = Alarm.decode(payload)
        heard = self.alarms.setdefault((alarm.station, alarm.id), [])
        if not heard or heard[-1] != alarm:
            heard.append(alarm)

    @contextlib.contextmanager
    def _simulated_world(self) -> Iterator[None]:
        """Clock, PLC connections and disks of this site in place of the real ones."""
        loop = asyncio.get_running_loop()
        write = FolderStore.write
        real = atomic_file.atomic_file

        def time_ns() -> int:
            return START_NS + round((loop.time() + self.clock_s) * NS_PER_S)

        def keep(store: FolderStore, batch: Batch) -> int:
            if self.is_disk_full:
                raise StoreError("no space left on device (simulated)")
            return write(store, batch)

        @contextlib.contextmanager
        def file(path: Path, *args: Any, **kwargs: Any) -> Iterator[Any]:
            if self.is_disk_full:
                raise RecordingError(f"{path}: no space left on device (simulated)")
            with real(path, *args, **kwargs) as opened:
                yield opened

        with contextlib.ExitStack() as patches:
            for target, replacement in (
                ("wetwell.services.runtime.clock.time", SimpleNamespace(time_ns=time_ns)),
                ("wetwell.services.gateway.poller.connection_to", lambda plc: self.plcs[plc.station].connection()),
                ("wetwell.services.gateway.poller.random", self.dice),
                ("wetwell.services.alarms.daemon.LOOK_S", 1.0 * self.period_s),
                ("wetwell.services.alarms.daemon.SAVE_S", 60.0 * self.period_s),
                ("wetwell.services.detector.checkpoint.atomic_file", file),
                ("wetwell.services.alarms.state_file.atomic_file", file),
                ("wetwell.services.historian.store.folder_store.FolderStore.write", keep),
            ):
                patches.enter_context(mock.patch(target, replacement))
            yield


async def _each(subscription: Any, note: Callable[[bytes], None]) -> None:
    while True:
        for payload in await subscription.receive():
            note(payload)
