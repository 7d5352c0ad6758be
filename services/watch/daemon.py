"""The watch as a process: any number of stations, each looked at when a day of it is over."""

import asyncio
import contextlib
import logging
import os
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import SITE, gap_key
from wetwell.protocols.errors import LinkError
from wetwell.protocols.messages.status import ServiceState
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped, ticks
from wetwell.services.runtime.settings import Settings, WatchSettings
from wetwell.services.watch.history import kept_recording, kept_spans, told_faults
from wetwell.services.watch.station_watcher import StationWatcher
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.fleet.fleet_prior import fleet_prior
from wetwell.sim2real.watch.finding import finding_of
from wetwell.sim2real.watch.watching import diagnosed_plainly

log = logging.getLogger(__name__)

NICE = 10
"""It is in no hurry: what judges and shows comes first."""
DAY_S = 86_400.0


async def serve_watch(settings: Settings, stations: Sequence[Station]) -> None:
    """Watch the gaps of stations until stopped. A router or a historian that is away is waited for.

    Raises
    ------
    ConfigError
        If the folder of the state cannot be used.
    """
    with contextlib.suppress(OSError):  # where that is not allowed the unit says it
        os.nice(NICE)
    await run_until_stopped(_run(settings, stations), "watch.run")


async def _run(settings: Settings, stations: Sequence[Station]) -> None:
    kept = settings.watch
    watchers: list[StationWatcher] = []

    def with_prior(recording: Recording, station: Station, only: Collection[str] | None) -> Diagnosis:
        findings = [found for each in watchers if (found := finding_of(each.state)) is not None]
        return diagnosed_plainly(recording, station, only, fleet_prior(findings, without=station.name).priors)

    diagnosed = with_prior if kept.fleet_prior else diagnosed_plainly
    watchers += [StationWatcher(station, kept.state_dir, diagnosed) for station in stations]
    with await connect(settings) as bus, ThreadPoolExecutor(kept.threads) as pool:
        if kept.state_dir is None:
            log.info("watch.state_dir is not set: what the watch knows ends with the process")
        await watch_all(bus, watchers, kept, settings.health.period_s, pool)


async def watch_all(
    bus: Bus,
    watchers: Sequence[StationWatcher],
    kept: WatchSettings,
    health_period_s: float,
    pool: ThreadPoolExecutor,
) -> None:
    """Look at stations for ever, whenever a day of one is over; what is told is published."""
    service = WatchService(bus, watchers, pool)
    service.publish_all()
    async with asyncio.TaskGroup() as group:
        group.create_task(
            report_health(bus, SITE, "watch", health_period_s, service.figures, service.condition),
            name="watch.health",
        )
        async for _ in ticks(kept.ask_s):
            await service.look(kept.threads)


class WatchService:
    """Looks at the stations that are due, a few at a time, and publishes what is told of them."""

    def __init__(self, bus: Bus, watchers: Sequence[StationWatcher], pool: ThreadPoolExecutor) -> None:
        self._bus = bus
        self._watchers = watchers
        self._pool = pool
        self._publishers = {each.station.name: bus.publisher(gap_key(each.station.name)) for each in watchers}
        self._behind_s = dict.fromkeys(self._publishers, 0.0)
        self._missing = ""

    async def look(self, at_once: int) -> None:
        """Look at all that is due; what the historian cannot give now is asked for again the next time."""
        try:
            spans = await kept_spans(self._bus)
        except LinkError as error:
            self._tell_missing(str(error))
            return
        self._tell_missing("")
        free = asyncio.Semaphore(at_once)

        async def catch_up(watcher: StationWatcher) -> None:
            async with free:
                await self._catch_up(watcher, *spans[watcher.station.name])

        known = [watcher for watcher in self._watchers if watcher.station.name in spans]
        await asyncio.gather(*(catch_up(watcher) for watcher in known))

    async def _catch_up(self, watcher: StationWatcher, first_ns: int, newest_ns: int) -> None:
        """Look at one span of a station after another, until none is due."""
        name, loop = watcher.station.name, asyncio.get_running_loop()
        while (span := watcher.due(first_ns, newest_ns)) is not None:
            self._behind_s[name] = (newest_ns - span[1]) / 1e9
            try:
                recording = await kept_recording(self._bus, name, *span)
                faults = await told_faults(self._bus, name, *span)
            except LinkError as error:
                self._tell_missing(str(error))
                return
            await loop.run_in_executor(self._pool, watcher.look, span, recording, faults)
            self._publish(watcher)
        self._behind_s[name] = 0.0

    def publish_all(self) -> None:
        """Publish what is known of each station, after a restart."""
        for watcher in self._watchers:
            self._publish(watcher)

    def _publish(self, watcher: StationWatcher) -> None:
        if (message := watcher.message) is not None:
            self._publishers[watcher.station.name].put(message.encode())

    def _tell_missing(self, why: str) -> None:
        if why and why != self._missing:
            log.warning("%s; asked again", why)
        self._missing = why

    def condition(self) -> tuple[ServiceState, str]:
        """Waiting while the historian does not tell what was kept."""
        return ("waiting", self._missing) if self._missing else ("running", "")

    def figures(self) -> dict[str, float]:
        """Health figures."""
        return {
            "stations": float(len(self._watchers)),
            "looks": float(sum(each.looks for each in self._watchers)),
            "diagnoses": float(sum(each.diagnoses for each in self._watchers)),
            "refused": float(sum(bool(each.state.refused) for each in self._watchers)),
            "gaps_doubled": float(sum(each.state.is_doubled for each in self._watchers)),
            "behind_days": max(self._behind_s.values(), default=0.0) / DAY_S,
            "disk_errors": float(max((each.write_errors for each in self._watchers), default=0)),
        }
