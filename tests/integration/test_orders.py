"""Orders of an operator to the detector, and its checkpoint, over a bus."""

import asyncio

import pytest

from wetwell.detector.learning import LEARNING_S
from wetwell.protocols.keys import order_key, sample_key
from wetwell.protocols.memory_link import MemoryBus
from wetwell.protocols.messages import Order, Verdict
from wetwell.services.checkpoint import Checkpoint
from wetwell.services.detector import StationJudge
from wetwell.services.orders import ordered
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SECONDS = int(LEARNING_S) + 7_200


@pytest.fixture(scope="module")
def payloads(alpha) -> list[bytes]:
    recording = Simulation(alpha, Scenario(name="plain"), 2).advance(SECONDS)
    return [sample.encode() for sample in recording.samples(alpha.name)]


def order(act: str, number: int, pump: int = 2) -> Order:
    return Order.model_validate(
        {"id": f"order-{number}", "time": number, "station": "alpha", "pump": pump, "act": act, "by": "a tester"}
    )


async def answers(alpha, payloads: list[bytes], orders: list[Order]) -> list[Verdict]:
    """Answers to orders that follow on the samples."""
    with MemoryBus() as bus:
        judge = StationJudge(bus, alpha)
        tasks = [asyncio.create_task(judge.run()), asyncio.create_task(judge.obey())]
        publisher = bus.publisher(sample_key("alpha"))
        for number, payload in enumerate(payloads):
            publisher.put(payload)
            if number % 1000 == 0:
                await asyncio.sleep(0)
        await asyncio.sleep(0)
        bus.publisher(order_key("alpha")).put(b"no order")
        bus.publisher(order_key("alpha")).put(order("rebaseline", 99, pump=9).encode())
        told = [await asyncio.wait_for(ordered(bus, one), 30.0) for one in orders]
        assert judge.figures()["malformed_orders"] == judge.figures()["foreign_orders"] == 1.0
        for task in tasks:
            task.cancel()
        return told


def test_a_rebaseline_is_carried_out_once_answered_and_can_be_taken_back(alpha, payloads):
    orders = [order("revert", 1), order("rebaseline", 2), order("rebaseline", 2), order("revert", 3)]
    nothing, learning, again, back = asyncio.run(answers(alpha, payloads, orders))
    assert (nothing.state, nothing.evidence["reason"]) == ("normal", "no baseline was put aside")
    assert (learning.state, learning.evidence["by"]) == ("learning", "a tester")
    assert again == learning
    assert back.state == "unknown"
    assert (back.evidence["reason"], back.evidence["baseline"]) == ("baseline taken back by an operator", 1)


def test_a_checkpoint_is_taken_up_and_a_damaged_one_is_put_aside(alpha, tmp_path, caplog):
    with MemoryBus() as bus:
        checkpoint = Checkpoint(tmp_path / "state", "alpha")
        judge = StationJudge(bus, alpha)
        assert not checkpoint.restore(judge.detector)
        checkpoint.save(judge.detector)
        other = StationJudge(bus, alpha)
        assert checkpoint.restore(other.detector)
        assert other.detector.snapshot() == judge.detector.snapshot()
        (file,) = (tmp_path / "state").iterdir()
        file.write_bytes(file.read_bytes()[:-10])
        assert not checkpoint.restore(StationJudge(bus, alpha).detector)
    assert "damaged, its checksum differs; kept as alpha.detector.refused, learning starts again" in caplog.text
    assert [path.name for path in (tmp_path / "state").iterdir()] == ["alpha.detector.refused"]
