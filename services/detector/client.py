"""Orders of an operator to a running detector, and its answer."""

import asyncio
import uuid

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import order_key, verdict_key
from wetwell.protocols.messages.order import Order
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.runtime.client import ask_service
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.settings import Settings

ANSWER_S = 10.0
REPEAT_S = 1.0


async def send_order(settings: Settings, station: str, pump: int, act: str, by: str) -> Verdict:
    """Send an order over Zenoh and wait for the verdict that answers it.

    Raises
    ------
    LinkError
        If no detector answers within `ANSWER_S`.
    """
    order = Order.model_validate(
        {"id": uuid.uuid4().hex, "time": now_ns(), "station": station, "pump": pump, "act": act, "by": by}
    )
    silence = f"station '{station}': no detector"
    return await ask_service(settings, lambda bus: ordered(bus, order), silence, ANSWER_S)


async def ordered(bus: Bus, order: Order) -> Verdict:
    """Send an order on a bus until the verdict that answers it is there; the detector heeds each order once."""
    answers = bus.subscribe(verdict_key(order.station, order.pump))
    publisher = bus.publisher(order_key(order.station))
    while True:
        publisher.put(order.encode())
        try:
            payloads = await asyncio.wait_for(answers.receive(), REPEAT_S)
        except TimeoutError:
            continue
        for payload in payloads:
            verdict = Verdict.decode(payload)
            if verdict.evidence.get("order") == order.id:
                return verdict
