"""The alarms daemon: owns bus and clocks, and gives what comes to the service."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Sequence
from typing import TypeVar

from wetwell.protocols.bus.interface import Bus, Keyed, Request, Subscription
from wetwell.protocols.bus.keys import (
    SITE,
    alarm_act_key,
    alarm_report_key,
    alive_key,
    gap_key,
    sample_block_key,
    sample_key,
    status_key,
    verdict_key,
)
from wetwell.protocols.station.station_file import Station
from wetwell.services.alarms.service import SOURCES, AlarmService, Kept
from wetwell.services.alarms.state_file import KeptSite
from wetwell.services.alarms.station_clock import Now
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.folder_lock import folder_held
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped, ticks
from wetwell.services.runtime.settings import Settings
from wetwell.services.security.audit import LineAudit

log = logging.getLogger(__name__)

T = TypeVar("T")

SAMPLE_HISTORY = 600
VERDICT_HISTORY = 100
LOOK_S = 1.0
PACE_S = 0.1
"""Alarms wait for seconds before they are raised: nobody waits for a tenth. [s]"""
SAVE_S = 60.0


async def serve_alarms(settings: Settings, stations: Sequence[Station], *, is_held: bool = False) -> None:
    """Keep the alarms of a site until stopped. A router that is away is waited for.

    Parameters
    ----------
    settings : Settings
    stations : sequence of Station
        Whose files are known; others are taken from the bus, without limits of the level.
    is_held : bool
        Whether they are simulated plants that stand until all parts are ready: until one is let go, nothing of it is
        missed.

    Raises
    ------
    ConfigError
        If the folder of the state cannot be used.
    """
    await run_until_stopped(_run(settings, stations, is_held=is_held), "alarms.run")


async def _run(settings: Settings, stations: Sequence[Station], *, is_held: bool) -> None:
    if settings.lease.url is not None:
        await _keep_in_turn(settings, stations, is_held=is_held)
    with await connect(settings) as bus:
        await keep_alone(settings, bus, stations, is_held=is_held)


async def _keep_in_turn(settings: Settings, stations: Sequence[Station], *, is_held: bool) -> None:
    """Keep the alarms of a site for ever while this process owns the role; stand by while it does not."""
    from wetwell.services.lease.membership import Membership  # noqa: PLC0415
    from wetwell.services.lease.outbox import KeptRequest, Outbox, OutboxPlace  # noqa: PLC0415 - only pairs need it

    with contextlib.closing(Membership(settings.lease, "alarms")) as role:
        while True:
            with await connect(settings) as bus:
                await role.take(bus)

                async def work(outbox: Outbox, bus: Bus = bus) -> None:
                    kept = Kept(
                        KeptSite(OutboxPlace(outbox, "alarms")), LineAudit(outbox.last_line, outbox.write_down)
                    )
                    service = AlarmService(outbox, settings.alarms, stations, clocks, kept, is_held=is_held)
                    try:
                        await keep(bus, service, settings.health.period_s, lambda one: KeptRequest(one, outbox))
                    finally:
                        service.save()

                await role.act(bus, work)


async def keep_alone(settings: Settings, bus: Bus, stations: Sequence[Station], *, is_held: bool = False) -> None:
    """Keep the alarms of a site for ever, as the one who keeps their state in this folder; it is saved at the end.

    Raises
    ------
    ConfigError
        If others work there, or the folder cannot be used; in a group, once another one is in its place.
    """
    kept = settings.alarms
    with folder_held(kept.state_dir, "alarms.state_dir", "alarms") as hold:
        service = AlarmService(bus, kept, stations, clocks, is_held=is_held)
        try:
            if kept.state_dir is None:
                log.info("alarms.state_dir is not set: acts are only logged, and the state ends with the process")
            async with asyncio.TaskGroup() as group:
                group.create_task(hold.watch(), name="alarms.hold")
                group.create_task(keep(bus, service, settings.health.period_s), name="alarms.keep")
        finally:
            if not hold.is_lost:
                service.save()


async def keep(
    bus: Bus,
    service: AlarmService,
    health_period_s: float,
    asked: Callable[[Request], Request] = lambda request: request,
) -> None:
    """Let the alarms of a site work on a bus for ever; acts of operators are answered through `asked`."""
    samples = bus.subscribe(sample_key("*"), history=SAMPLE_HISTORY, capacity=100_000, pace_s=PACE_S)
    sample_blocks = bus.subscribe(sample_block_key("*"), history=SAMPLE_HISTORY, capacity=100_000, pace_s=PACE_S)
    verdicts = bus.subscribe(verdict_key("*"), history=VERDICT_HISTORY, pace_s=PACE_S)
    gaps = bus.subscribe(gap_key("*"), history=1, pace_s=PACE_S)
    statuses = bus.collect([status_key("*", source) for source in sorted(SOURCES)], history=1, pace_s=PACE_S)
    presences = bus.watch(alive_key("*", "*"))
    acts, reports = bus.answer(alarm_act_key("*")), bus.answer(alarm_report_key())
    service.publish_all()

    def figures() -> dict[str, float]:
        heard = (samples, sample_blocks, verdicts, gaps, statuses)
        dropped, missed = sum(one.dropped for one in heard), sum(one.missed for one in heard)
        return service.figures() | {"dropped": float(dropped), "missed": float(missed)}

    def answer_report(request: Request) -> None:
        request.reply(service.report().encode())

    def handle_act(request: Request) -> None:
        service.handle_act(asked(request))

    def handle_status(message: Keyed) -> None:
        service.handle_status(message[1])

    async with asyncio.TaskGroup() as group:
        group.create_task(_feed(samples, service.handle_sample, service), name="alarms.samples")
        group.create_task(_feed(sample_blocks, service.handle_sample_block, service), name="alarms.sample_blocks")
        group.create_task(_feed(verdicts, service.handle_verdict, service), name="alarms.verdicts")
        group.create_task(_feed(gaps, service.handle_gap, service), name="alarms.gaps")
        group.create_task(_feed(statuses, handle_status, service), name="alarms.statuses")
        group.create_task(_feed(presences, service.handle_presence, service), name="alarms.presences")
        group.create_task(_feed(acts, handle_act, service), name="alarms.acts")
        group.create_task(_feed(reports, answer_report, service), name="alarms.reports")
        group.create_task(_look(service), name="alarms.look")
        group.create_task(report_health(bus, SITE, "alarms", health_period_s, figures), name="alarms.health")


def clocks() -> Now:
    """The time of day, and the clock of the event loop."""
    return Now(now_ns(), asyncio.get_running_loop().time())


async def _feed(subscription: Subscription[T], handle: Callable[[T], None], service: AlarmService) -> None:
    while True:
        for message in await subscription.receive():
            handle(message)
        service.commit_in_time()
        await asyncio.sleep(0)  # let acts in between batches


async def _look(service: AlarmService) -> None:
    saved_s = 0.0
    async for elapsed_s in ticks(LOOK_S):
        service.look()
        if elapsed_s - saved_s >= SAVE_S:
            service.save()
            saved_s = elapsed_s
