"""What a commissioning engineer asks first: what would be read, and what a PLC says now."""

import asyncio
from collections.abc import Sequence

from wetwell.protocols.errors import LinkError
from wetwell.protocols.modbus.block_reads import plan_blocks
from wetwell.protocols.modbus.device_map import Plc
from wetwell.protocols.quantities import FIRST_PUMP, columns_of
from wetwell.protocols.units import house_unit
from wetwell.services.gateway.poll import poll_once
from wetwell.services.gateway.poller import connection_to

CONNECTIONS = 50
"""PLCs that are read at the same time."""


def described(plc: Plc) -> dict[str, object]:
    """Where a PLC is, with which requests it is polled, what is read of it and what is not."""
    device = plc.device
    columns = columns_of(plc.pumps)
    wanted = [*columns[:FIRST_PUMP], "heartbeat", *columns[FIRST_PUMP:]]
    return {
        "endpoint": plc.endpoint,
        "pumps": plc.pumps,
        "period_s": device.period_s,
        "requests": [
            {"table": block.table, "address": block.address, "count": block.count, "signals": len(block.names)}
            for block in plan_blocks(plc.signals, device.max_gap, device.max_words)
        ],
        "signals": [
            {
                "signal": name,
                "table": signal.table,
                "address": signal.address,
                "type": signal.type if signal.bit is None else f"bit {signal.bit}",
                "scale": signal.scale,
                "offset": signal.offset,
                "unit": signal.unit or house_unit(name),
            }
            for name, signal in plc.signals.items()
        ],
        "not_in_the_map": ", ".join(name for name in wanted if name not in plc.signals),
    }


async def read_all(plcs: Sequence[Plc]) -> dict[str, object]:
    """One poll of each PLC, by station; where there is none, "error" says why."""
    gate = asyncio.Semaphore(CONNECTIONS)

    async def one(plc: Plc) -> dict[str, object]:
        async with gate:
            return await _read(plc)

    results = await asyncio.gather(*map(one, plcs))
    return {plc.station: result for plc, result in zip(plcs, results, strict=True)}


async def _read(plc: Plc) -> dict[str, object]:
    device = plc.device
    where: dict[str, object] = {"endpoint": plc.endpoint}
    try:
        async with connection_to(plc) as connection:
            poll = await poll_once(connection, plc, plan_blocks(plc.signals, device.max_gap, device.max_words))
    except LinkError as error:
        return where | {"error": str(error)}
    rows = [
        {
            "signal": name,
            "value": _short(poll.values[name]),
            "unit": house_unit(name),
            "words": " ".join(f"{word:04X}" for word in poll.words.get(name, ())),
            "table": signal.table,
            "address": signal.address,
            "refused": poll.refused.get(name, ""),
        }
        for name, signal in plc.signals.items()
    ]
    return where | {"signals": rows}


def _short(value: float | None) -> float | None:
    """Without the digits that only binary numbers have."""
    return None if value is None else float(f"{value:.10g}")
