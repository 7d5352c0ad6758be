"""Enters acts of maintenance at the detector of a station, over a bus."""

import asyncio

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import maintenance_act_key, maintenance_key
from wetwell.protocols.messages.maintenance import MaintenanceAct, MaintenanceRecord

ANSWER_S = 10.0
REPEAT_S = 1.0


async def entered(bus: Bus, act: MaintenanceAct) -> MaintenanceRecord:
    """Publish an act until its record is there; the detector enters it once by its id."""
    records = bus.subscribe(maintenance_key(act.station))
    publisher = bus.publisher(maintenance_act_key(act.station))
    while True:
        publisher.put(act.encode())
        try:
            payloads = await asyncio.wait_for(records.receive(), REPEAT_S)
        except TimeoutError:
            continue
        for payload in payloads:
            record = MaintenanceRecord.decode(payload)
            if record.id == act.id:
                return record
