"""The gateway daemon: any number of PLCs in, samples on the bus out."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.modbus.device_map import Plc
from wetwell.services.gateway.poller import PlcPoller
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped
from wetwell.services.runtime.sample_sender import SampleSender
from wetwell.services.runtime.settings import Settings

log = logging.getLogger(__name__)

SERVICE = "gateway"


async def serve_gateway(settings: Settings, plcs: Sequence[Plc]) -> None:
    """Poll PLCs until stopped. A router or a PLC that is away is waited for."""
    await run_until_stopped(_run(settings, plcs), "gateway.run")


async def _run(settings: Settings, plcs: Sequence[Plc]) -> None:
    longest_wait_s, gather_s = settings.gateway.longest_wait_s, settings.zenoh.gather_s
    with await connect(settings) as bus:
        await poll_all(bus, plcs, settings.health.period_s, longest_wait_s, gather_s)


async def poll_all(
    bus: Bus, plcs: Sequence[Plc], health_s: float, longest_wait_s: float, gather_s: float = 0.0
) -> None:
    """Poll PLCs for ever, one task each; they begin spread over a second, so that not all are asked at once."""
    senders = [SampleSender(bus, plc.station, gather_s, 1.0 / plc.device.period_s) for plc in plcs]
    pollers = [PlcPoller(plc, sender.put, longest_wait_s) for plc, sender in zip(plcs, senders, strict=True)]
    with contextlib.ExitStack() as stack:
        for sender in senders:
            stack.callback(sender.flush)
        await _poll(bus, pollers, health_s)


async def _poll(bus: Bus, pollers: Sequence[PlcPoller], health_s: float) -> None:
    log.info("polling %d PLCs", len(pollers))
    async with asyncio.TaskGroup() as group:
        for index, poller in enumerate(pollers):
            delay_s = index / len(pollers) * min(poller.plc.device.period_s, 1.0)
            name = poller.plc.station
            group.create_task(_later(delay_s, poller.run), name=f"gateway.poll.{name}")
            group.create_task(
                _later(delay_s, _reporter(bus, poller, health_s)),
                name=f"gateway.health.{name}",
            )
        group.create_task(
            report_health(bus, SITE, SERVICE, health_s, lambda: _site_figures(pollers)), name="gateway.health"
        )


async def _later(delay_s: float, begin: Callable[[], Coroutine[Any, Any, None]]) -> None:
    await asyncio.sleep(delay_s)
    await begin()


def _reporter(bus: Bus, poller: PlcPoller, health_s: float) -> Callable[[], Coroutine[Any, Any, None]]:
    return lambda: report_health(
        bus, poller.plc.station, SERVICE, health_s, poller.figures, condition=poller.condition
    )


def _site_figures(pollers: Sequence[PlcPoller]) -> dict[str, float]:
    states = [poller.condition()[0] for poller in pollers]
    return {"plcs": float(len(states)), "plcs_waiting": float(states.count("waiting"))}
