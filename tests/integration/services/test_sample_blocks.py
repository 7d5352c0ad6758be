"""Gathered samples: the same verdicts, alarms and pages as one by one, at any place of the service."""

import asyncio
import json

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.interface import ALL_KEPT
from wetwell.protocols.bus.keys import sample_block_key, sample_key, verdict_key
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import MOST_SAMPLES, SampleBlock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.dashboard.view.site_view import SiteView
from wetwell.services.detector.follower import Room, Waiting
from wetwell.services.detector.intake import Intake
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.historian.daemon import keep
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.runtime.sample_sender import SampleSender
from wetwell.services.runtime.settings import AlarmSettings
from wetwell.services.stations import find_scenario
from wetwell.simulator.simulation import Simulation

HOURS = 9


@pytest.fixture(scope="module")
def samples(alpha) -> list[Sample]:
    """Nine hours: learning, and a pump fault."""
    recording = Simulation(alpha, find_scenario("demo"), 5).advance(HOURS * 3600)
    return [
        sample.model_copy(update={"quality": "uncertain"}) if 5_000 <= sample.seq < 5_003 else sample
        for sample in recording.samples("alpha")
    ]


async def gathered(samples: list[Sample], gather_s: float, pause_at: int) -> list[SampleBlock]:
    """Blocks that a sender makes; before sample `pause_at` more time goes by than it gathers."""
    with MemoryBus() as bus:
        heard = bus.subscribe(sample_block_key("alpha"), history=600)
        sender = SampleSender(bus, "alpha", gather_s)
        for number, sample in enumerate(samples):
            if number == pause_at:
                await asyncio.sleep(2.0 * gather_s)
            sender.put(sample)
        sender.flush()
        sender.flush()
        return [SampleBlock.decode(payload) for payload in await heard.receive()]


def test_gathered_samples_go_out_when_time_is_up_when_enough_are_there_and_where_their_kind_changes(samples):
    blocks = asyncio.run(gathered(samples[4_990:6_000], 0.05, pause_at=3))
    assert [len(block.seq) for block in blocks] == [3, 7, 3, MOST_SAMPLES, 1_010 - 13 - MOST_SAMPLES]
    assert [block.quality for block in blocks] == ["good", "good", "uncertain", "good", "good"]
    assert [sample for block in blocks for sample in block.samples()] == samples[4_990:6_000]


def test_without_a_time_to_gather_each_sample_goes_out_by_itself(samples):
    async def sent() -> list[bytes]:
        with MemoryBus() as bus:
            heard = bus.subscribe(sample_key("alpha"))
            sender = SampleSender(bus, "alpha", 0.0)
            for sample in samples[:3]:
                sender.put(sample)
            return await heard.receive()

    assert [Sample.decode(payload) for payload in asyncio.run(sent())] == samples[:3]


def test_a_late_joiner_gets_the_last_600_samples_whatever_number_of_messages_they_came_in(samples):
    async def kept(qualities: list[str]) -> list[Sample]:
        with MemoryBus() as bus:
            sender = SampleSender(bus, "alpha", 30.0)
            for sample, quality in zip(samples, qualities, strict=False):
                sender.put(sample.model_copy(update={"quality": quality}))
            sender.flush()
            late = bus.subscribe(sample_block_key("alpha"), history=600)
            return [sample for payload in await late.receive() for sample in SampleBlock.decode(payload).samples()]

    assert len(asyncio.run(kept(["good", "uncertain"] * 500))) == 600
    assert len(asyncio.run(kept(["good"] * 1_800))) == 600


@pytest.mark.parametrize(("rate_hz", "kept"), [(1.0, 600), (5.0, 600), (10.0, 1_200)])
def test_two_minutes_on_the_wall_are_kept_however_fast_the_station_runs(samples, rate_hz, kept):
    async def there() -> int:
        with MemoryBus() as bus:
            sender = SampleSender(bus, "alpha", 0.0, rate_hz)
            for sample in samples[:2_000]:
                sender.put(sample)
            return len(await bus.subscribe(sample_key("alpha"), history=ALL_KEPT).receive())

    assert asyncio.run(there()) == kept


def test_a_historian_takes_all_that_a_source_of_small_blocks_has_kept(samples, tmp_path):
    async def taken() -> float:
        with MemoryBus() as bus:
            sender = SampleSender(bus, "alpha", 1.0)
            for sample in samples[:300]:
                sender.put(sample)
                sender.flush()
            store = FolderStore(tmp_path)
            historian = Historian(store)
            keeping = asyncio.create_task(keep(bus, historian, 60.0, 60.0, 60.0))
            while historian.figures(0)["taken"] < 300.0:  # noqa: ASYNC110 - nothing else tells it
                await asyncio.sleep(0.0)
            keeping.cancel()
            store.close()
            return historian.figures(0)["taken"]

    assert asyncio.run(taken()) == 300.0


def test_what_waits_while_a_station_catches_up_is_bounded_and_what_goes_is_counted(samples):
    singles, blocks = [sample.encode() for sample in samples[:4]], [*payloads(samples[4:24], 10), b"{}"]
    room = Room(sum(map(len, [*singles[2:], *blocks])))
    waiting = Waiting(room)
    waiting.extend(singles, Sample)
    waiting.extend(blocks, SampleBlock)
    assert room.dropped == 2
    assert [sample.seq for sample in waiting.samples()] == list(range(2, 24))


def payloads(samples: list[Sample], size: int) -> list[bytes]:
    """Blocks of so many samples; where their kind changes one ends."""
    blocks, block = [], list[Sample]()
    for sample in samples:
        if block and (len(block) == size or block[-1].quality != sample.quality):
            blocks.append(block)
            block = []
        block.append(sample)
    return [SampleBlock.of(block).encode() for block in [*blocks, block]]


async def verdicts_of(alpha, messages: list[tuple[str, bytes]]) -> tuple[list[bytes], bytes]:
    """Verdicts that a detector publishes on what comes over the bus, and its state afterwards."""
    with MemoryBus() as bus:
        verdicts = bus.subscribe(verdict_key("alpha"), capacity=100_000)
        publishers = {key: bus.publisher(key) for key, _ in messages}
        judge = StationDetector(bus, alpha)
        judging = asyncio.create_task(Intake(bus, [judge]).run())
        for number, (key, payload) in enumerate(messages):
            publishers[key].put(payload)
            if number % 100 == 0:
                await asyncio.sleep(0.0)
        while judge.figures().get("samples", 0.0) < HOURS * 3600:  # noqa: ASYNC110 - nothing else tells it
            await asyncio.sleep(0.0)
        judging.cancel()
        return await verdicts.receive(), judge.detector.snapshot()


def test_verdicts_on_gathered_samples_are_those_on_single_ones_to_the_byte(alpha, samples):
    single = [(sample_key("alpha"), sample.encode()) for sample in samples]
    right, state = asyncio.run(verdicts_of(alpha, single))
    assert {Verdict.decode(payload).state for payload in right} >= {"learning", "normal", "pump_fault"}
    for size in (10, 600):
        blocks = [(sample_block_key("alpha"), payload) for payload in payloads(samples, size)]
        assert asyncio.run(verdicts_of(alpha, blocks)) == (right, state)


def test_a_sample_that_cannot_be_judged_takes_none_of_its_block_along(alpha, samples, monkeypatch, caplog):
    told = []
    single = [sample.encode() for sample in samples[:3_000]]
    for kind, messages in ((Sample, single), (SampleBlock, payloads(samples[:3_000], 600))):
        with MemoryBus() as bus:
            verdicts = bus.subscribe(verdict_key("alpha"))
            judge = StationDetector(bus, alpha)
            monkeypatch.setattr(judge.detector, "_judged", lambda _: 1 / 0)
            judge.handle_payloads(messages, kind)
            told.append(asyncio.run(verdicts.receive()))
        figures = judge.figures()
        assert figures["failures"] > 0
        assert figures["samples"] == 3_000
    assert "on could not be judged" in caplog.text
    assert len(told[0]) == 3  # that each pump begins
    assert told[1] == told[0]


def test_foreign_and_malformed_blocks_are_counted_and_left_out(alpha, samples):
    with MemoryBus() as bus:
        judge = StationDetector(bus, alpha)
        block = SampleBlock.of(samples[:5])
        judge.handle_payloads(
            [b"{}", block.model_copy(update={"station": "beta"}).encode(), block.encode()], SampleBlock
        )
    assert {name: judge.figures()[name] for name in ("malformed", "foreign", "samples")} == {
        "malformed": 1.0,
        "foreign": 1.0,
        "samples": 5.0,
    }


def test_alarms_and_page_know_from_blocks_what_they_know_from_samples(alpha, samples):
    high = [sample.model_copy(update={"level_m": 9.0}) for sample in samples[:200]]
    services, views = [], []
    for kind in ("handle_sample", "handle_sample_block"):
        with MemoryBus() as bus:
            service = AlarmService(bus, AlarmSettings(), [alpha], lambda: Now(0, 0.0))
            view = SiteView(stale_s=10.0)
            view.advance(0.0)
            size = 10 if kind == "handle_sample_block" else 1
            messages = payloads(high, 10) if kind == "handle_sample_block" else [sample.encode() for sample in high]
            for number, payload in enumerate(messages, start=1):
                getattr(service, kind)(payload)
                getattr(view, kind)(payload)
                for quarter in range(4 * size):
                    view.advance(number * size + quarter / 4.0)
            services.append(service)
            views.append(view)
    for service in services:
        assert service.figures()["samples"] == 200.0
        assert service.registry.is_wanted("alpha", "level_high")
    assert views[0].stations["alpha"].sample == views[1].stations["alpha"].sample == replace_none(high[-1])
    single, gathered = (json.loads(view.station_state("alpha"))["rows"] for view in views)
    assert len(single) == 200
    assert gathered == single


def replace_none(sample: Sample) -> Sample:
    """As it comes out of JSON."""
    return Sample.decode(sample.encode())
