"""A fleet on a real Dask cluster over a real Zenoh router: what is judged is what one process judges."""

import asyncio
import contextlib
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from ports import free_port

pytest.importorskip("distributed")

from distributed import Client, LocalCluster

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.bus.interface import Presence, Request, Subscription
from wetwell.protocols.bus.keys import alive_key, history_key, sample_key, status_key, verdict_key
from wetwell.protocols.bus.zenoh.link import ZenohBus, open_router
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.fleet.controller import Fleet
from wetwell.services.fleet.inventory import Inventory
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.runtime.settings import DetectorSettings, FleetSettings, HealthSettings, Settings, ZenohSettings
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

pytestmark = [
    pytest.mark.long,
    pytest.mark.filterwarnings("ignore"),  # of Dask's own threads and sockets at a kill
]

Verdicts = dict[str, dict[tuple[int, int], bytes]]
"""Payload by station, time and pump."""

NAMES = ("north", "south", "east", "west")
HOURS = 7
PART = 3600


def station_file(name: str) -> str:
    pump = "curve = [36.0, -0.02333, -1.3333e-4]"
    return f'name = "{name}"\n[sump]\narea_m2 = 8.0\n[[pump]]\n{pump}\n[[pump]]\n{pump}\n'


@contextlib.asynccontextmanager
async def running_fleet(folder: Path, bus: ZenohBus, endpoint: str) -> AsyncIterator[tuple[Fleet, Client]]:
    settings = Settings(
        zenoh=ZenohSettings(endpoint=endpoint),
        detector=DetectorSettings(state_dir=folder / "state", checkpoint_s=1.0),
        fleet=FleetSettings(shards=3, period_s=0.2),
        health=HealthSettings(period_s=0.5),
    )
    cluster = LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, asynchronous=True
    )
    async with cluster, Client(cluster, asynchronous=True) as client:
        fleet = Fleet(settings, client, bus, Inventory(folder / "stations"))
        task = asyncio.create_task(fleet.run())
        try:
            yield fleet, client
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            await fleet.end()


async def judged_and_wanted(tmp_path: Path) -> tuple[Verdicts, Verdicts]:
    """What a fleet says while a worker is killed and a station comes, and what one process would say."""
    (tmp_path / "stations").mkdir()
    for name in NAMES[:3]:
        (tmp_path / "stations" / f"{name}.toml").write_text(station_file(name))
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with open_router(endpoint) as bus:
        verdicts = bus.subscribe(verdict_key("*"), history=100, capacity=100_000)
        async with running_fleet(tmp_path, bus, endpoint) as (_, client):
            (tmp_path / "stations" / f"{NAMES[3]}.toml").write_text(station_file(NAMES[3]))
            (tmp_path / "stations" / "wrong.toml").write_text('name = "wrong"\n')
            inventory = Inventory(tmp_path / "stations").stations()
            assert set(inventory) == set(NAMES)
            samples = {
                name: list(Simulation(station, Scenario(name="plain"), number).advance(HOURS * 3600).samples(name))
                for number, (name, station) in enumerate(inventory.items())
            }
            publishers = {name: bus.publisher(sample_key(name), history=HOURS * 3600) for name in NAMES}
            store = FolderStore(tmp_path / "history", keep_live_days=1)
            historian = Historian(store)
            answering = asyncio.create_task(answer(bus.answer(history_key("*")), historian))
            statuses = bus.subscribe(status_key("*", "detector"))
            await judged(bus.watch(alive_key("*", "detector")))
            got: Verdicts = {name: {} for name in NAMES}
            for first in range(0, HOURS * 3600, PART):
                for name in NAMES:
                    for sample in samples[name][first : first + PART]:
                        payload = sample.encode()
                        historian.handle("samples", payload)
                        publishers[name].put(payload)
                if first == 3 * 3600:
                    workers = await client.run(os.getpid)
                    os.kill(next(iter(workers.values())), signal.SIGKILL)
                await caught_up(statuses, first + PART)
            wanted = {name: undisturbed(inventory[name], samples[name]) for name in NAMES}
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(60):
                    while any(wanted[name].keys() - got[name].keys() for name in NAMES):
                        await collect(verdicts, got, quiet_s=0.5)
            answering.cancel()
            store.close()
    return got, wanted


def test_verdicts_are_those_of_one_process_though_a_worker_is_killed_and_a_station_comes(tmp_path):
    got, wanted = asyncio.run(judged_and_wanted(tmp_path))
    assert got == wanted
    assert any(b'"normal"' in payload for payload in wanted["north"].values())


async def judged(watch: Subscription[Presence]) -> None:
    """Wait until every station has its judge."""
    missing = {alive_key(name, "detector") for name in NAMES}
    async with asyncio.timeout(60):
        while missing:
            missing -= {presence.key for presence in await watch.receive() if presence.is_alive}


async def caught_up(statuses: Subscription[bytes], number: int) -> None:
    """Wait until every station has so many samples: a judge that is away longer than its mailbox holds loses some."""
    behind = set(NAMES)
    async with asyncio.timeout(60):
        while behind:
            for payload in await statuses.receive():
                status = Status.decode(payload)
                if status.figures.get("samples", 0.0) >= number:
                    behind.discard(status.station)


async def answer(requests: Subscription[Request], historian: Historian) -> None:
    """Let a historian answer."""
    while True:
        for request in await requests.receive():
            historian.commit(0)
            request.reply(historian.answer(request.key.split("/")[1], request.payload))


async def collect(verdicts, got: Verdicts, quiet_s: float) -> None:
    """Take verdicts until none comes for a while; one that comes twice must be the same."""
    with contextlib.suppress(TimeoutError):
        while True:
            for payload in await asyncio.wait_for(verdicts.receive(), quiet_s):
                verdict = Verdict.decode(payload)
                heard = got[verdict.station].setdefault((verdict.time, verdict.pump), payload)
                assert heard == payload


def undisturbed(station, samples: list[Sample]) -> dict[tuple[int, int], bytes]:
    detector = Detector(station.name, datasheet_of(station))
    told = [verdict for sample in samples for verdict in detector.update(sample)]
    return {(verdict.time, verdict.pump): verdict.encode() for verdict in told}
