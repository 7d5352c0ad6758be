"""The replay daemon: a recording on the bus as if it were live."""

import asyncio
import logging
from collections.abc import Sequence

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.runtime.clock import tick_period_s
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped, ticks
from wetwell.services.runtime.sample_sender import SampleSender
from wetwell.services.runtime.settings import Settings

log = logging.getLogger(__name__)

MAX_STEP_S = 60.0
"""A longer pause in the recording is cut to this length in the replay; the time stamps stay as they are."""


async def serve_replay(settings: Settings, recording: Recording, station: str, speed: float) -> None:
    """Publish the rows of a recording in the rhythm of their time stamps, then return."""
    await run_until_stopped(_run(settings, recording, station, speed), "replay.run")


async def _run(settings: Settings, recording: Recording, station: str, speed: float) -> None:
    with await connect(settings) as bus:
        due_s = _schedule_s(recording)
        rate_hz = speed * len(due_s) / max(due_s[-1], 1.0) if due_s else speed
        sender = SampleSender(bus, station, settings.zenoh.gather_s, rate_hz)
        try:
            await _publish(settings, bus, sender, recording, station, speed, due_s)
        finally:
            sender.flush()


async def _publish(
    settings: Settings,
    bus: Bus,
    sender: SampleSender,
    recording: Recording,
    station: str,
    speed: float,
    due_s: Sequence[float],
) -> None:
    published = 0
    health = asyncio.create_task(
        report_health(
            bus, station, "replay", settings.health.period_s, lambda: {"rows": float(published), "speed": speed}
        ),
        name="replay.health",
    )
    log.info("station '%s': %d rows at speed %g", station, len(recording), speed)
    samples = recording.samples(station)
    async for elapsed_s in ticks(tick_period_s(speed)):
        while published < len(due_s) and due_s[published] <= elapsed_s * speed:
            sender.put(next(samples))
            published += 1
        if published == len(due_s):
            break
    health.cancel()
    log.info("station '%s': replay has ended", station)


def _schedule_s(recording: Recording) -> list[float]:
    """When each row is due, in s of the station; never falling, pauses cut short."""
    due_s, schedule, last_ns = 0.0, [], int(recording.time_ns[0]) if len(recording) else 0
    for stamp_ns in recording.time_ns.tolist():
        due_s += min(max((stamp_ns - last_ns) / NS_PER_S, 0.0), MAX_STEP_S)
        last_ns = stamp_ns
        schedule.append(due_s)
    return schedule
