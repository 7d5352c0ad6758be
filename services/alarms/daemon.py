"""The alarms daemon: owns bus and clocks, and gives what comes to the keeper."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Sequence
from typing import TypeVar

from wetwell.protocols.bus.interface import Bus, Request, Subscription
from wetwell.protocols.bus.keys import (
    SITE,
    alarm_act_key,
    alarm_report_key,
    alive_key,
    sample_block_key,
    sample_key,
    status_key,
    verdict_key,
)
from wetwell.protocols.station.station_file import Station
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_watch import Now
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.lifecycle import report_health, stop_event, ticks, until
from wetwell.services.runtime.settings import Settings

log = logging.getLogger(__name__)

T = TypeVar("T")

SAMPLE_HISTORY = 600
VERDICT_HISTORY = 100
LOOK_S = 1.0
SAVE_S = 60.0


async def serve_alarms(settings: Settings, stations: Sequence[Station]) -> None:
    """Keep the alarms of a site until stopped. A router that is away is waited for.

    Parameters
    ----------
    settings : Settings
    stations : sequence of Station
        Whose files are known; others are taken from the bus, without limits of the level.

    Raises
    ------
    ConfigError
        If the folder of the state cannot be used.
    """
    async with stop_event() as stop, contextlib.AsyncExitStack() as stack:
        await until(stop, asyncio.create_task(_run(settings, stations, stack), name="alarms.run"))


async def _run(settings: Settings, stations: Sequence[Station], stack: contextlib.AsyncExitStack) -> None:
    bus = stack.enter_context(await connect(settings))
    keeper = AlarmService(bus, settings.alarms, stations, clocks)
    stack.callback(keeper.save)
    if settings.alarms.state_dir is None:
        log.info("alarms.state_dir is not set: acts are only logged, and the state ends with the process")
    await keep(bus, keeper, settings.health.period_s)


async def keep(bus: Bus, keeper: AlarmService, health_period_s: float) -> None:
    """Let a keeper work on a bus for ever."""
    samples = bus.subscribe(sample_key("*"), history=SAMPLE_HISTORY, capacity=100_000)
    sample_blocks = bus.subscribe(sample_block_key("*"), history=SAMPLE_HISTORY, capacity=100_000)
    verdicts = bus.subscribe(verdict_key("*"), history=VERDICT_HISTORY)
    statuses = bus.subscribe(status_key("*", "gateway"), history=1)
    presences = bus.watch(alive_key("*", "*"))
    acts, reports = bus.answer(alarm_act_key("*")), bus.answer(alarm_report_key())
    keeper.publish_all()

    def figures() -> dict[str, float]:
        dropped = samples.dropped + sample_blocks.dropped + verdicts.dropped + statuses.dropped
        return keeper.figures() | {"dropped": float(dropped)}

    def answer_report(request: Request) -> None:
        request.reply(keeper.report().encode())

    async with asyncio.TaskGroup() as group:
        group.create_task(_feed(samples, keeper.take_sample, keeper), name="alarms.samples")
        group.create_task(_feed(sample_blocks, keeper.take_sample_block, keeper), name="alarms.sample_blocks")
        group.create_task(_feed(verdicts, keeper.take_verdict, keeper), name="alarms.verdicts")
        group.create_task(_feed(statuses, keeper.take_status, keeper), name="alarms.statuses")
        group.create_task(_feed(presences, keeper.take_presence, keeper), name="alarms.presences")
        group.create_task(_feed(acts, keeper.take_act, keeper), name="alarms.acts")
        group.create_task(_feed(reports, answer_report, keeper), name="alarms.reports")
        group.create_task(_look(keeper), name="alarms.look")
        group.create_task(report_health(bus, SITE, "alarms", health_period_s, figures), name="alarms.health")


def clocks() -> Now:
    """The time of day, and the clock of the event loop."""
    return Now(now_ns(), asyncio.get_running_loop().time())


async def _feed(subscription: Subscription[T], take: Callable[[T], None], keeper: AlarmService) -> None:
    while True:
        for message in await subscription.receive():
            take(message)
        keeper.commit()
        await asyncio.sleep(0)  # let acts in between batches


async def _look(keeper: AlarmService) -> None:
    saved_s = 0.0
    async for elapsed_s in ticks(LOOK_S, asyncio.Event()):
        keeper.look()
        if elapsed_s - saved_s >= SAVE_S:
            keeper.save()
            saved_s = elapsed_s
