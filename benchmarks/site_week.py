"""Days of station time through detector, historian and alarms in one process, for the slope of its memory."""

import asyncio
import gc
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

import numpy as np
from memory_bus import MemoryBus
from site_processes import cpu_and_memory

from wetwell.protocols.bus.interface import Subscription
from wetwell.protocols.bus.keys import alarm_key, sample_key, verdict_key
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.detector.checkpoint import checkpoint_in
from wetwell.services.detector.intake import Intake
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.runtime.sample_sender import LEAST_KEPT
from wetwell.services.runtime.settings import AlarmSettings
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

HOUR_S = 3_600
SCENARIOS = ("nominal", "demo")


class Week:
    """The classes of the daemons on a bus in memory, under the clock of the samples."""

    def __init__(self, folder: Path, stations: int) -> None:
        model = find_station("alpha")
        self._plants = [
            Simulation(model.model_copy(update={"name": f"s{n}"}), find_scenario(SCENARIOS[n % 2]), seed=n + 1)
            for n in range(stations)
        ]
        files = [plant.station for plant in self._plants]
        bus, self._clock = MemoryBus(), Now(0, 0.0)
        self._historian = Historian(FolderStore(folder / "history"))
        self._service = AlarmService(bus, AlarmSettings(state_dir=folder / "alarms"), files, lambda: self._clock)
        self._judges = [
            StationDetector(bus, station, checkpoint=checkpoint_in(folder / "state", station.name))
            for station in files
        ]
        self._intake = Intake(bus, self._judges)
        self._publishers = [bus.publisher(sample_key(station.name), history=LEAST_KEPT) for station in files]
        self._samples, self._verdicts = bus.subscribe(sample_key("*")), bus.subscribe(verdict_key("*"))
        self._alarms = bus.subscribe(alarm_key("*"))
        self._kept = 0

    async def live(self, days: int) -> list[tuple[float, int]]:
        """Memory of the process in MB and objects of Python, at the end of each hour."""
        tasks = [
            asyncio.create_task(self._intake.run()),
            asyncio.create_task(self._feed(self._samples, self._handle_sample)),
            asyncio.create_task(self._feed(self._verdicts, self._handle_verdict)),
            asyncio.create_task(
                self._feed(self._alarms, lambda payload: self._historian.handle("alarms", payload)),
            ),
        ]
        hours = []
        for hour in range(24 * days):
            await self._hour(hour)
            gc.collect()
            hours.append((memory_mb(), len(gc.get_objects())))
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return hours

    async def _hour(self, hour: int) -> None:
        recordings = [plant.advance(HOUR_S, truth=False) for plant in self._plants]
        feeds = [
            recording.samples(plant.station.name, hour * HOUR_S)
            for plant, recording in zip(self._plants, recordings, strict=True)
        ]
        for minute in range(1, 61):
            end = 60 * minute
            self._clock = Now(int(recordings[0].time_ns[end - 1]), float(HOUR_S * hour + end))
            for publisher, feed in zip(self._publishers, feeds, strict=True):
                for _ in range(60):
                    publisher.put(next(feed).encode())
            while (  # noqa: ASYNC110 - what is waited for are other tasks
                self._kept < (HOUR_S * hour + end) * len(feeds)
                or min(judge.figures().get("samples", 0.0) for judge in self._judges) < HOUR_S * hour + end
            ):
                await asyncio.sleep(0)
            self._service.look()
            self._historian.commit(self._clock.wall_ns)
        while self._historian.maintain(self._clock.wall_ns):
            pass
        for judge in self._judges:
            judge.keep()
        self._service.save()

    async def _feed(self, inbox: Subscription[bytes], handle: Callable[[bytes], None]) -> None:
        while True:
            for payload in await inbox.receive():
                handle(payload)
            self._service.commit()

    def _handle_sample(self, payload: bytes) -> None:
        self._historian.handle("samples", payload)
        self._service.handle_sample(payload)
        self._kept += 1

    def _handle_verdict(self, payload: bytes) -> None:
        self._historian.handle("verdicts", payload)
        self._service.handle_verdict(payload)


def memory_mb() -> float:
    """Resident memory of this process."""
    return cpu_and_memory(os.getpid())[1]


def memory_of_a_week(folder: Path, stations: int, days: int) -> dict[str, object]:
    """Memory after each day, and its slope over the second half, when all that is bounded is full."""
    begun_s = time.process_time()
    hours = np.array(asyncio.run(Week(folder, stations).live(days)))
    cpu_s = time.process_time() - begun_s
    late = np.arange(len(hours)) >= len(hours) // 2
    by_day = np.polyfit(np.arange(len(hours))[late] / 24.0, hours[late], 1)[0]
    return {
        "stations": stations,
        "days": days,
        "cpu_us_a_sample": round(1e6 * cpu_s / (stations * days * 24 * HOUR_S), 1),
        "memory_after_each_day_mb": [round(float(value), 1) for value in hours[23::24, 0]],
        "objects_after_each_day": [int(value) for value in hours[23::24, 1]],
        "memory_slope_mb_a_day": round(float(by_day[0]), 3),
        "objects_slope_a_day": round(float(by_day[1]), 1),
    }
