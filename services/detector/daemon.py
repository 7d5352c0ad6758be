"""The detector as a process: any number of stations, their checkpoints, and what was missed while it was away."""

import asyncio
import contextlib
import gc
import itertools
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from wetwell.protocols.bus.interface import Bus, Outlet
from wetwell.protocols.bus.keys import status_key
from wetwell.protocols.messages.status import Status
from wetwell.protocols.station.station_file import Station
from wetwell.services.detector.checkpoint import Checkpoint, checkpoint_in
from wetwell.services.detector.follower import Follower
from wetwell.services.detector.intake import LOOK_AGAIN_S, Intake
from wetwell.services.detector.kernels import load_kernels
from wetwell.services.detector.quarantine import Quarantine
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.detector.unheard import say_unheard
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.folder_lock import Hold, folder_held
from wetwell.services.runtime.lifecycle import report_health_in_turn, run_until_stopped, ticks
from wetwell.services.runtime.settings import Settings
from wetwell.services.security.audit import audit_in

if TYPE_CHECKING:
    from wetwell.services.lease.outbox import Outbox

log = logging.getLogger(__name__)

AGES_KEPT = 2.0
"""A member that stands by keeps the samples of so many checkpoint periods: one may be late by a whole one."""
LEAST_FOLLOWED_S = 30.0
"""And of so much longer: from a state that was taken until it is written, and until the lease is over. [s]"""
KEPT_TURN_S = 0.25
"""States of many stations are saved in turns of this length: to wake a process costs more than what it does. [s]"""


async def serve_detector(settings: Settings, stations: Sequence[Station]) -> None:
    """Judge stations until stopped. A router that is away is waited for."""
    await run_until_stopped(_run(settings, stations), "detector.run")


async def _run(settings: Settings, stations: Sequence[Station]) -> None:
    await asyncio.to_thread(load_kernels)  # before it shows that it is there: samples come then
    if settings.lease.url is not None:
        await _judge_in_turn(settings, stations)
    with await connect(settings) as bus:
        await judge_alone(settings, bus, stations)


async def _judge_in_turn(settings: Settings, stations: Sequence[Station]) -> None:
    """Judge stations for ever while this process owns the role; follow their samples while it does not."""
    from wetwell.services.lease.membership import Membership  # noqa: PLC0415 - only pairs need it

    kept_s = AGES_KEPT * settings.detector.checkpoint_s + LEAST_FOLLOWED_S
    with contextlib.closing(Membership(settings.lease, "detector")) as role:
        while True:
            with await connect(settings) as bus:
                follower = Follower(bus, [station.name for station in stations], kept_s)
                following = asyncio.create_task(follower.run(), name="detector.follow")
                try:
                    await role.take(bus, follower.is_ready)
                finally:
                    following.cancel()

                async def work(outbox: "Outbox", bus: Bus = bus, follower: Follower = follower) -> None:
                    await judge_all(settings, bus, stations, "detector", Turn(outbox, follower))

                await role.act(bus, work)


@dataclass(frozen=True)
class Turn:
    """What a detector has that takes over from another: where it tells and keeps, and who has followed until now."""

    outbox: "Outbox"
    follower: Follower

    def checkpoint(self, station: str) -> Checkpoint:
        """Checkpoint of a station in the ledger."""
        from wetwell.services.lease.outbox import OutboxPlace  # noqa: PLC0415 - only pairs need it

        return Checkpoint(OutboxPlace(self.outbox, station))


async def judge_alone(settings: Settings, bus: Bus, stations: Sequence[Station]) -> None:
    """Judge stations for ever, as the one detector that keeps its state in this folder.

    Raises
    ------
    ConfigError
        If another detector works there, or the folder cannot be used; in a group, once another one is in its place.
    """
    with folder_held(settings.detector.state_dir, "detector.state_dir", "detector") as hold:
        async with asyncio.TaskGroup() as group:
            group.create_task(hold.watch(), name="detector.hold")
            group.create_task(judge_all(settings, bus, stations, "detector", hold=hold), name="detector.judge")


async def judge_all(
    settings: Settings,
    bus: Bus,
    stations: Sequence[Station],
    name: str,
    turn: Turn | None = None,
    hold: Hold | None = None,
) -> None:
    """Judge stations for ever; their states are saved at the end.

    Parameters
    ----------
    settings : Settings
        Where states are kept, and how often.
    bus : Bus
        Where samples come from and verdicts go to.
    stations : sequence of Station
        Those that have brought the process down too often are left out, and told.
    name : str
        Of this group of stations, for the trace of a crash.
    turn : Turn, optional
        Of one of a pair.
    hold : Hold, optional
        Of the folder of states: once it is lost, none is saved at the end.
    """
    kept = settings.detector
    outlet: Outlet = bus if turn is None else turn.outbox
    audit = audit_in(settings.security.audit_dir, "detector")
    quarantine = Quarantine(kept.state_dir, name, kept.crash_tries, kept.crash_window_s)
    async with contextlib.AsyncExitStack() as stack, asyncio.TaskGroup() as group:
        stack.callback(quarantine.close)
        judges: list[StationDetector] = []
        for station in stations:
            if quarantine.holds(station.name):
                log.error("station '%s': left out after %d crashes", station.name, kept.crash_tries)
                group.create_task(_show_left_out(bus, station.name, settings.health.period_s))
                continue
            checkpoint = (
                checkpoint_in(kept.state_dir, station.name) if turn is None else turn.checkpoint(station.name)
            )
            judge = StationDetector(outlet, station, kept.costs, checkpoint, quarantine, audit)
            stack.callback(_keep_at_the_end, judge, hold)
            judges.append(judge)
        intake = Intake(bus, judges, None if turn is None else turn.follower)
        gc.freeze()  # looking through the states of a thousand stations for garbage takes a quarter of a second
        stack.callback(gc.unfreeze)
        log.info("%d stations: waiting for samples", len(judges))
        group.create_task(intake.run(), name=f"{name}.intake")
        figures = {judge.station: partial(_figures, judge, intake) for judge in judges}
        group.create_task(
            report_health_in_turn(bus, "detector", settings.health.period_s, figures), name=f"{name}.health"
        )
        group.create_task(keep_in_turn(judges, intake, kept.checkpoint_s), name=f"{name}.checkpoint")
        group.create_task(say_unheard(bus, judges), name=f"{name}.unheard")


def _keep_at_the_end(judge: StationDetector, hold: Hold | None) -> None:
    if hold is None or not hold.is_lost:
        judge.keep()


async def _show_left_out(bus: Bus, station: str, period_s: float) -> None:
    """Say on the bus that a station is not judged, for ever."""
    publisher = bus.publisher(status_key(station, "detector"))
    async for _ in ticks(period_s):
        status = Status(
            time=now_ns(), station=station, service="detector", state="stopping", figures={"left_out": 1.0}
        )
        publisher.put(status.encode())


def _figures(judge: StationDetector, intake: Intake) -> dict[str, float]:
    return judge.figures() | {"dropped": float(intake.dropped)}


async def keep_in_turn(judges: Sequence[StationDetector], intake: Intake, period_s: float) -> None:
    """Save each detector once a period, some in each turn, so that no second bears all of them.

    The oldest state comes first, and at once: where processes live shortly, one after another, each station has its
    turn. One that has yet to take what it has missed comes when it has, as its state is the one that is kept already.
    """
    turns = dict.fromkeys(sorted(judges, key=lambda judge: judge.detector.seen_until_ns))
    in_a_turn = max(1, int(len(turns) * KEPT_TURN_S / period_s))
    while turns:
        ready = list(itertools.islice((judge for judge in turns if not intake.is_behind(judge)), in_a_turn))
        if not ready:
            await asyncio.sleep(LOOK_AGAIN_S)
            continue
        for judge in ready:
            del turns[judge]
            turns[judge] = None  # comes last now
            await judge.keep_aside()
        await asyncio.sleep(period_s * len(ready) / len(turns))
