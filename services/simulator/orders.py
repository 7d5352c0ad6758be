"""Orders to the clock of the plant: hold, release, speed, a slow look; each is answered with how it stands then."""

import asyncio
from collections.abc import Callable

from wetwell.protocols.bus.interface import Request, Subscription
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.plant_clock import PlantClock, PlantClockOrder
from wetwell.services.simulator.pace import Pace


async def obey(
    orders: Subscription[Request], station: str, pace: Pace, seconds: Callable[[], int], changed: asyncio.Event
) -> None:
    """Carry out orders for ever, and set `changed` with each. One that is none is answered with what is wrong."""
    clock = asyncio.get_running_loop().time
    while True:
        for request in await orders.receive():
            error = ""
            try:
                carry_out(PlantClockOrder.decode(request.payload), pace, clock())
            except MessageError as broken:
                error = str(broken)
            answer = PlantClock(
                station=station,
                seconds=seconds(),
                speed=pace.speed,
                full_speed=pace.full_speed,
                is_held=pace.is_held,
                error=error,
            )
            request.reply(answer.encode())
            changed.set()


def carry_out(order: PlantClockOrder, pace: Pace, now_s: float) -> None:
    """Let the clock do what an order says."""
    if order.speed is not None:
        pace.set_speed(now_s, order.speed)
    if order.is_held is not None:
        (pace.hold if order.is_held else pace.release)(now_s)
    if order.look_s:
        pace.look(now_s, order.look_s)
