"""The controller of a fleet: what it wants of Dask, and how it gets there again and again."""

import asyncio
import contextlib
import logging
import os
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from distributed import Client, Future, LocalCluster, fire_and_forget

from wetwell.protocols.bus.interface import Bus, Publisher
from wetwell.protocols.bus.keys import SITE, plan_key
from wetwell.protocols.errors import LinkError
from wetwell.protocols.messages.order import Plan
from wetwell.protocols.station.station_file import Station
from wetwell.services.fleet.inventory import Inventory
from wetwell.services.fleet.placement import moves, shard_of
from wetwell.services.fleet.shard import run_shard
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.lifecycle import report_health, stop_event, ticks, until
from wetwell.services.runtime.settings import Settings

log = logging.getLogger(__name__)

KEY = re.compile(r"wetwell-shard-(\d+)-(\d+)")
RETRIES = 1_000_000
"""How often Dask starts a shard again by itself: for years."""
END_S = 15.0
"""So long a shard may take to save its states and end."""


async def serve_fleet(settings: Settings, inventory: Path) -> None:
    """Keep the stations of an inventory judged until stopped; at the end the shards end too.

    Raises
    ------
    ConfigError
        If the inventory cannot be read.
    LinkError
        If there is no scheduler at the address of the settings.
    """
    stations = Inventory(inventory)
    async with stop_event() as stop, contextlib.AsyncExitStack() as stack:
        client = await stack.enter_async_context(_dask(settings))
        await until(stop, asyncio.create_task(_keep(settings, client, stations), name="fleet.keep"))


async def _keep(settings: Settings, client: Client, stations: Inventory) -> None:
    with await connect(settings) as bus:
        fleet = Fleet(settings, client, bus, stations)
        try:
            await fleet.run()
        except asyncio.CancelledError:
            await fleet.end()
            raise


@contextlib.asynccontextmanager
async def _dask(settings: Settings) -> AsyncIterator[Client]:
    """Client of the scheduler that the settings name, or of a cluster on this machine."""
    async with contextlib.AsyncExitStack() as stack:
        address: Any = settings.fleet.scheduler
        if address is None:
            workers = settings.fleet.workers or os.cpu_count() or 1
            address = await stack.enter_async_context(
                LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    dashboard_address=None,
                    asynchronous=True,
                )
            )
        try:
            yield await stack.enter_async_context(Client(address, asynchronous=True, timeout=10))
        except (OSError, TimeoutError) as error:
            raise LinkError(f"fleet.scheduler: no scheduler answers at {address}") from error


class Fleet:
    """Keeps each shard on a worker, evenly, with the plan that the inventory makes of it.

    Shards outlive the controller (the scheduler keeps them); a controller that starts takes up those that it finds.
    """

    def __init__(self, settings: Settings, client: Client, bus: Bus, inventory: Inventory) -> None:
        self._settings = settings
        self._client = client
        self._bus = bus
        self._inventory = inventory
        self._epochs: dict[int, int] = {}
        self._futures: dict[int, Future[int]] = {}
        self._plans: dict[int, tuple[Station, ...]] = {}
        self._publishers: dict[int, Publisher] = {}
        self._counts = {"moved": 0.0, "started": 0.0, "failed": 0.0}

    async def run(self) -> None:
        """Look around for ever."""
        await self._adopt_shards()
        async with asyncio.TaskGroup() as group:
            group.create_task(
                report_health(self._bus, SITE, "fleet", self._settings.health.period_s, self._figures),
                name="fleet.health",
            )
            async for _ in ticks(self._settings.fleet.period_s):
                await self._step()

    async def end(self) -> None:
        """Let all shards save their states and end."""
        for shard in list(self._futures):
            self._epochs[shard] += 1
            self._tell(shard, ())
        await self._ended(list(self._futures.values()))

    async def _adopt_shards(self) -> None:
        """Find the shards that an earlier controller has left behind."""
        for key in await self._client.run_on_scheduler(_keys):
            if match := KEY.fullmatch(key):
                shard, epoch = int(match[1]), int(match[2])
                if epoch >= self._epochs.get(shard, -1):
                    self._epochs[shard], self._futures[shard] = epoch, Future(key, self._client)

    async def _step(self) -> None:
        planned = self._planned()
        for shard, stations in planned.items():
            future = self._futures.get(shard)
            if future is None or future.done():
                await self._start(shard, stations, None if future is None else future)
            elif stations != self._plans.get(shard):
                self._tell(shard, stations)
        await self._balance()

    def _planned(self) -> dict[int, tuple[Station, ...]]:
        number = self._settings.fleet.shards
        planned: dict[int, list[Station]] = {shard: [] for shard in range(number)}
        for name, station in sorted(self._inventory.stations().items()):
            planned[shard_of(name, number)].append(station)
        return {shard: tuple(stations) for shard, stations in planned.items()}

    async def _start(
        self, shard: int, stations: tuple[Station, ...], before: Future[int] | None, worker: str | None = None
    ) -> None:
        if before is not None and before.status == "error":
            self._counts["failed"] += 1.0
            log.error("shard %d: %s; starts again", shard, await before.exception())
        self._epochs[shard] = self._epochs.get(shard, -1) + 1
        self._tell(shard, stations)
        plan = self._plan(shard, stations)
        future = self._client.submit(
            run_shard,
            self._settings,
            plan,
            key=f"wetwell-shard-{shard}-{plan.epoch}",
            pure=False,
            retries=RETRIES,
            workers=None if worker is None else [worker],
            allow_other_workers=worker is not None,
        )
        fire_and_forget(future)
        self._futures[shard] = future
        self._counts["started"] += 1.0

    async def _balance(self) -> None:
        processing = await self._client.processing()
        here = {future.key: shard for shard, future in self._futures.items()}
        load = {worker: [here[key] for key in keys if key in here] for worker, keys in processing.items()}
        for shard, worker in moves(load).items():
            log.info("shard %d moves to %s", shard, worker)
            stations, before = self._plans[shard], self._futures[shard]
            self._epochs[shard] += 1
            self._tell(shard, ())  # the old task ends when it sees a later epoch
            await self._ended([before])
            self._epochs[shard] -= 1
            await self._start(shard, stations, before, worker)
            self._counts["moved"] += 1.0

    async def _ended(self, futures: list[Future[int]]) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(END_S):
                await asyncio.gather(*(future for future in futures), return_exceptions=True)

    def _plan(self, shard: int, stations: tuple[Station, ...]) -> Plan:
        return Plan(time=now_ns(), shard=shard, epoch=self._epochs[shard], stations=stations)

    def _tell(self, shard: int, stations: tuple[Station, ...]) -> None:
        if shard not in self._publishers:
            self._publishers[shard] = self._bus.publisher(plan_key(shard), history=1)
        self._publishers[shard].put(self._plan(shard, stations).encode())
        self._plans[shard] = stations

    def _figures(self) -> dict[str, float]:
        stations = float(sum(map(len, self._plans.values())))
        return self._counts | {"stations": stations, "wrong_files": float(len(self._inventory.wrong))}


def _keys(dask_scheduler: Any) -> list[str]:
    return [str(key) for key in dask_scheduler.tasks]
