"""Acts of maintenance at a detector on a bus: entered, kept over a restart, judged by the runs that follow."""

import asyncio
import json

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import maintenance_key
from wetwell.protocols.messages.maintenance import MaintenanceAct, MaintenanceRecord
from wetwell.protocols.messages.order import Order
from wetwell.protocols.messages.sample import Sample
from wetwell.services.detector.checkpoint import checkpoint_in
from wetwell.services.detector.intake import Intake
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.runtime.maintenance import entered
from wetwell.services.security.audit import audit_in
from wetwell.services.security.audit_chain import broken_lines
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


def test_acts_of_maintenance_and_orders_are_in_the_audit_once_and_a_full_disk_holds_up_none(tmp_path) -> None:
    audit = audit_in(tmp_path, "detector")
    judge = StationDetector(MemoryBus(), ALPHA, audit=audit)
    order = Order(id="five", time=0, station="alpha", pump=1, act="rebaseline", by="eve")
    for _ in range(2):
        judge.handle_maintenance(act("pump:2", "pulled", "one").encode())
        judge.handle_order(order.encode())
    lines = [json.loads(line) for line in audit.path.read_text().splitlines()]
    assert [(line["act"], line["by"], line["id"], line["station"]) for line in lines] == [
        ("maintenance", "ann", "one", "alpha"),
        ("rebaseline", "eve", "five", "alpha"),
    ]
    assert (lines[0]["asset"], lines[0]["done"], lines[0]["found"]) == ("pump:2", "pulled", "rags")
    assert broken_lines(audit.path) == []
    audit.path.unlink()
    audit.path.mkdir()
    judge.handle_order(order.model_copy(update={"id": "six"}).encode())
    assert judge.figures()["audit_errors"] == 1.0
    assert judge.figures()["verdicts"] == 3.0  # the one that was asked for twice, and the last


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
