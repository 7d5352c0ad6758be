"""Orders of an operator to the detector, and its checkpoint, over a bus."""

import asyncio

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import order_key, sample_key
from wetwell.protocols.messages.order import Order
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import LEARNING_S
from wetwell.services.detector.checkpoint import Told, checkpoint_in
from wetwell.services.detector.client import ordered
from wetwell.services.detector.intake import Intake
from wetwell.services.detector.station_detector import StationDetector
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
        judge = StationDetector(bus, alpha)
        running = asyncio.create_task(Intake(bus, [judge]).run())
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
        running.cancel()
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
        checkpoint = checkpoint_in(tmp_path / "state", "alpha")
        judge = StationDetector(bus, alpha, checkpoint=checkpoint)
        assert not judge.is_restored
        judge.keep()
        other = StationDetector(bus, alpha, checkpoint=checkpoint)
        assert other.is_restored
        assert other.detector.snapshot() == judge.detector.snapshot()
        (file,) = (tmp_path / "state").iterdir()
        whole = file.read_bytes()
        file.write_bytes(whole[:-10])
        assert not StationDetector(bus, alpha, checkpoint=checkpoint).is_restored
        file.write_bytes(whole[5:])
        assert not StationDetector(bus, alpha, checkpoint=checkpoint).is_restored
    assert "damaged, its checksum differs; kept as alpha.detector.refused, learning starts again" in caplog.text
    assert [path.name for path in (tmp_path / "state").iterdir()] == ["alpha.detector.refused"]


def test_a_late_writer_does_not_put_an_older_state_over_a_newer_one(alpha, payloads, tmp_path):
    with MemoryBus() as bus:
        checkpoint = checkpoint_in(tmp_path, "alpha")
        judge = StationDetector(bus, alpha, checkpoint=checkpoint)
        older = checkpoint.encode(judge.detector, Told({}))
        judge.handle_payloads(payloads)
        judge.keep()
        checkpoint.write(*older)
        assert StationDetector(bus, alpha, checkpoint=checkpoint).detector.snapshot() == judge.detector.snapshot()


def test_a_checkpoint_of_version_0_1_which_is_a_bare_snapshot_is_taken_up(alpha, tmp_path):
    with MemoryBus() as bus:
        judge = StationDetector(bus, alpha)
        (tmp_path / "alpha.detector.json").write_bytes(judge.detector.snapshot())
        assert StationDetector(bus, alpha, checkpoint=checkpoint_in(tmp_path, "alpha")).is_restored


def test_an_order_that_was_answered_is_known_after_a_kill(alpha, payloads, tmp_path):
    async def orders_before_and_after_a_kill() -> tuple[Verdict, Verdict, int]:
        with MemoryBus() as bus:
            first = StationDetector(bus, alpha, checkpoint=checkpoint_in(tmp_path, "alpha"))
            await first.judge_in_turns(Sample.decode(payload) for payload in payloads)
            obeying = asyncio.create_task(Intake(bus, [first]).run())
            answer = await asyncio.wait_for(ordered(bus, order("rebaseline", 7)), 30.0)
            obeying.cancel()
        with MemoryBus() as bus:  # nothing of the first one is left but its checkpoint
            second = StationDetector(bus, alpha, checkpoint=checkpoint_in(tmp_path, "alpha"))
            obeying = asyncio.create_task(Intake(bus, [second]).run())
            again = await asyncio.wait_for(ordered(bus, order("rebaseline", 7)), 30.0)
            obeying.cancel()
            return answer, again, int(second.figures()["samples"])

    answer, again, samples = asyncio.run(orders_before_and_after_a_kill())
    assert again == answer
    assert samples == len(payloads)
