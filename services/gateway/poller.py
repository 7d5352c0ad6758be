"""The life of one PLC in the gateway: connect, poll on each tick, close after an error, try again."""

import asyncio
import random
from collections.abc import Callable

from wetwell.protocols.errors import LinkError
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.status import ServiceState
from wetwell.protocols.modbus.block_reads import plan_blocks
from wetwell.protocols.modbus.client import ModbusConnection, RefusedError
from wetwell.protocols.modbus.device_map import Plc
from wetwell.services.gateway.feed import StationFeed
from wetwell.services.gateway.poll import poll_once
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.lifecycle import ticks

FIRST_WAIT_S = 1.0
"""Upper limit of the random wait before a connection is made anew; it doubles with each one that brings no poll."""


def connection_to(plc: Plc) -> ModbusConnection:
    """Connection to a PLC, not yet opened."""
    device = plc.device
    return ModbusConnection(
        device.host,
        device.port,
        device.unit_id,
        connect_timeout_s=device.connect_timeout_s,
        answer_timeout_s=device.answer_timeout_s,
        tls=plc.tls,
        server_name=device.tls.server_name if device.tls is not None else None,
    )


class PlcPoller:
    """Polls one PLC for ever and hands on its samples; what happens to it disturbs no other.

    Parameters
    ----------
    plc : Plc
        The PLC.
    publish : callable
        Gets each sample.
    longest_wait_s : float
        Longest wait before a connection is made anew. [s]
    """

    def __init__(self, plc: Plc, publish: Callable[[Sample], None], longest_wait_s: float) -> None:
        self.plc = plc
        self._publish = publish
        self._longest_wait_s = longest_wait_s
        self._feed = StationFeed(plc)

    def figures(self) -> dict[str, float]:
        """Health figures."""
        return self._feed.figures(_now_s())

    def condition(self) -> tuple[ServiceState, str]:
        """State, and why."""
        return self._feed.condition(_now_s())

    async def run(self) -> None:
        """Poll for ever."""
        attempt = 0
        while True:
            before = self._feed.counts["good_polls"]
            try:
                async with connection_to(self.plc) as connection:
                    self._feed.connected()
                    await self._poll(connection)
            except LinkError as error:
                self._feed.fail(error, _now_s())
            attempt = 0 if self._feed.counts["good_polls"] > before else attempt + 1
            longest_s = min(self._longest_wait_s, FIRST_WAIT_S * 2.0 ** min(attempt, 30))
            await asyncio.sleep(random.uniform(0.0, longest_s))

    async def _poll(self, connection: ModbusConnection) -> None:
        device = self.plc.device
        blocks = plan_blocks(self.plc.signals, device.max_gap, device.max_words)
        last = -1
        async for elapsed_s in ticks(device.period_s):
            tick = int(elapsed_s / device.period_s + 1e-6)
            self._feed.due(max(0.0, elapsed_s - tick * device.period_s), tick - last - 1)
            last = tick
            stamp_ns, begin_s = now_ns(), _now_s()
            try:
                poll = await poll_once(connection, self.plc, blocks)
            except RefusedError as error:
                self._feed.fail(error, _now_s())
                continue
            blocks = tuple(poll.blocks)
            sample = self._feed.handle_poll(poll, stamp_ns, _now_s() - begin_s, _now_s())
            if sample is not None:
                self._publish(sample)


def _now_s() -> float:
    return asyncio.get_running_loop().time()
