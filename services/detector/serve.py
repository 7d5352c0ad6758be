"""The detector as a process: any number of stations, their checkpoints, and what was missed while it was away."""

import asyncio
import contextlib
import logging
from collections.abc import Sequence

from wetwell.protocols.link import Bus
from wetwell.protocols.station import Station
from wetwell.services.bus import connect
from wetwell.services.daemon import report_health, stop_event, until
from wetwell.services.detector.catch_up import missed_samples
from wetwell.services.detector.checkpoint import Checkpoint
from wetwell.services.detector.judge import StationJudge
from wetwell.services.settings import Settings

log = logging.getLogger(__name__)


async def serve_detector(settings: Settings, stations: Sequence[Station]) -> None:
    """Judge stations until stopped. A router that is away is waited for."""
    async with stop_event() as stop, contextlib.AsyncExitStack() as stack:
        running = asyncio.create_task(_run(settings, stations, stack), name="detector.run")
        await until(stop, running)


async def _run(settings: Settings, stations: Sequence[Station], stack: contextlib.AsyncExitStack) -> None:
    bus = stack.enter_context(await connect(settings))
    judges = [_judge(settings, bus, station, stack) for station in stations]
    async with asyncio.TaskGroup() as group:
        group.create_task(_keep(judges, settings.detector.checkpoint_s), name="detector.checkpoint")
        for judge in judges:
            group.create_task(_work(bus, judge), name=f"detector.{judge.station}")
            group.create_task(judge.obey(), name=f"detector.{judge.station}.orders")
            group.create_task(
                report_health(bus, judge.station, "detector", settings.health.period_s, judge.figures),
                name=f"detector.{judge.station}.health",
            )


def _judge(settings: Settings, bus: Bus, station: Station, stack: contextlib.AsyncExitStack) -> StationJudge:
    judge = StationJudge(bus, station, settings.detector.costs, Checkpoint(settings.detector.state_dir, station.name))
    stack.callback(judge.keep)
    return judge


async def _work(bus: Bus, judge: StationJudge) -> None:
    """Take what was missed, then what comes; both overlap, and the detector drops what it has had."""
    if judge.is_restored:
        async for samples in missed_samples(bus, judge.station, judge.detector.seen_until_ns):
            await judge.take(samples)
    await judge.run()


async def _keep(judges: Sequence[StationJudge], period_s: float) -> None:
    """Save each detector once a period, one after the other, so that no second bears all of them."""
    while True:
        for judge in judges:
            await asyncio.sleep(period_s / len(judges))
            judge.keep()
