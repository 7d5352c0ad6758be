"""Acts of maintenance at a detector on a bus: entered, kept over a restart, judged by the runs that follow."""

import asyncio

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import maintenance_key
from wetwell.protocols.messages.maintenance import MaintenanceAct, MaintenanceRecord
from wetwell.protocols.messages.sample import Sample
from wetwell.services.detector.checkpoint import checkpoint_in
from wetwell.services.detector.intake import Intake
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.runtime.maintenance import entered
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.simulation import Simulation

ALPHA = find_station("alpha")
HOUR_S = 3600
PULLED_S = 14 * HOUR_S


@pytest.fixture(scope="module")
def samples() -> list[Sample]:
    """Twenty hours of a station; pump 2 loses speed from the tenth hour until it is pulled."""
    rags = Blockage(pump=2, speed_loss=0.1, start_s=10 * HOUR_S, end_s=PULLED_S, after="clear")
    scenario = find_scenario("nominal").model_copy(update={"fault": (rags,), "duration_s": 20 * HOUR_S})
    return list(Simulation(ALPHA, scenario, 5).advance(20 * HOUR_S).samples("alpha"))


def act(asset: str, what: str, name: str) -> MaintenanceAct:
    return MaintenanceAct(id=name, station="alpha", asset=asset, act=what, found="rags", by="ann")


def test_a_pump_that_was_pulled_is_back_and_the_log_outlives_a_restart(samples: list[Sample], tmp_path) -> None:
    bus = MemoryBus()
    told = bus.subscribe(maintenance_key("alpha"))
    judge = StationDetector(bus, ALPHA, checkpoint=checkpoint_in(tmp_path, "alpha"))
    judge.judge(samples[:PULLED_S])
    judge.handle_maintenance(act("pump:2", "pulled", "one").encode())
    judge.handle_maintenance(b"{}")
    judge.handle_maintenance(act("pump:9", "pulled", "two").encode())
    judge.handle_maintenance(act("pump:2", "pulled", "three").model_copy(update={"station": "beta"}).encode())
    again = StationDetector(bus, ALPHA, checkpoint=checkpoint_in(tmp_path, "alpha"))
    again.judge(samples[PULLED_S:])

    async def heard() -> list[MaintenanceRecord]:
        return [MaintenanceRecord.decode(payload) for payload in await told.receive()]

    pending, refused, checked = asyncio.run(heard())
    assert (pending.id, pending.result, pending.time) == ("one", "pending", samples[PULLED_S - 1].time)
    assert pending.before is not None
    assert abs(pending.before.value) > pending.before.limit
    assert "pump:9" in refused.refused
    assert (checked.id, checked.result) == ("one", "back")
    assert checked.after is not None
    assert abs(checked.after.value) < 0.1 * checked.after.limit
    assert {"malformed_acts": 1.0, "foreign_acts": 1.0}.items() <= judge.figures().items()


def test_an_act_over_the_bus_makes_a_pump_with_another_meter_learn_anew(samples: list[Sample]) -> None:
    async def run() -> MaintenanceRecord:
        bus = MemoryBus()
        judge = StationDetector(bus, ALPHA)
        judge.judge(samples[: 9 * HOUR_S])
        assert all(baseline is not None for baseline in judge.detector.baselines)
        taking = asyncio.create_task(Intake(bus, [judge]).run())
        async with asyncio.timeout(20.0):
            record = await entered(bus, act("sensor:pump2_flow_m3h", "calibrated", "four"))
        taking.cancel()
        assert [baseline is None for baseline in judge.detector.baselines] == [False, True, False]
        return record

    assert asyncio.run(run()).result == "learning anew"
