"""A detector that is killed at any moment: its verdicts are those of one that was not."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from memory_bus import MemoryBus

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.bus.interface import Request, Subscription
from wetwell.protocols.bus.keys import history_key, sample_block_key, sample_key, verdict_key
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.detector.checkpoint import checkpoint_in
from wetwell.services.detector.follower import Room, Waiting, stamp_of
from wetwell.services.detector.intake import Intake
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.stations import find_scenario
from wetwell.simulator.simulation import Simulation

HOURS = 9
KEPT = 600


@pytest.fixture(scope="module")
def samples(alpha) -> list[Sample]:
    return list(Simulation(alpha, find_scenario("demo"), 5).advance(HOURS * 3600).samples("alpha"))


@pytest.fixture(scope="module")
def undisturbed(alpha, samples) -> list[Verdict]:
    return judged(alpha, samples)


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    monkeypatch.setattr("wetwell.services.detector.intake.KEPT_S", 0.0)  # a bus in memory brings it at once


def judged(alpha, samples: list[Sample]) -> list[Verdict]:
    detector = Detector("alpha", datasheet_of(alpha))
    return [verdict for sample in samples for verdict in detector.update(sample)]


async def answer(requests: Subscription[Request], historian: Historian) -> None:
    """Let a historian answer."""
    while True:
        for request in await requests.receive():
            historian.commit(0)
            request.reply(historian.answer("alpha", request.payload))


def source(bus: MemoryBus, historian: Historian, samples: list[Sample], gather: int) -> Callable[[int], None]:
    """Sends a sample by its number to both, or, with `gather`, all since the last message once in a while."""
    key = sample_key if gather == 1 else sample_block_key
    publisher = bus.publisher(key("alpha"), history=KEPT // gather)

    def send(number: int) -> None:
        if (number + 1) % gather and number + 1 < len(samples):
            return
        gathered = samples[number // gather * gather : number + 1]
        payload = gathered[0].encode() if gather == 1 else SampleBlock.of(gathered).encode()
        historian.handle("samples" if gather == 1 else "blocks", payload)
        publisher.put(payload)

    return send


async def verdicts_of_killed(
    alpha, samples: list[Sample], folder: Path, cuts: list[int], away: int, gather: int = 1
) -> list[Verdict]:
    """Verdicts in order of their first arrival; the judge dies at each cut and comes back `away` samples later."""
    got: dict[bytes, Verdict] = {}
    with MemoryBus() as bus:
        verdicts = bus.subscribe(verdict_key("alpha"))
        store = FolderStore(folder / "history", keep_live_days=1)
        historian = Historian(store)
        answering = asyncio.create_task(answer(bus.answer(history_key("*")), historian))
        send = source(bus, historian, samples, gather)
        position = 0
        for cut in [*cuts, len(samples)]:
            judge = StationDetector(bus, alpha, checkpoint=checkpoint_in(folder, "alpha"))
            running = asyncio.create_task(Intake(bus, [judge]).run())
            checkpoint_at = cut - (cut * 7919) % 900  # some time before the kill
            for number in range(position, cut):
                send(number)
                if number % 200 == 0 or number + 1 == checkpoint_at:
                    await asyncio.sleep(0.0)
                    await asyncio.sleep(0.0)
                if number + 1 == checkpoint_at:
                    judge.keep()
            while (  # noqa: ASYNC110 - the last one may end its work, the others are killed anywhere
                cut == len(samples) and judge.detector.seen_until_ns < samples[-1].time
            ):
                await asyncio.sleep(0.0)
            for _ in range(5):
                await asyncio.sleep(0.0)
            running.cancel()
            position = min(cut + away, len(samples))
            for number in range(cut, position):
                send(number)
        answering.cancel()
        store.close()
        for payload in await verdicts.receive():
            got.setdefault(payload, Verdict.decode(payload))
    return list(got.values())


@pytest.mark.parametrize(
    ("seed", "away", "gather"),
    [
        (2, 300, 1),
        *(pytest.param(*one, marks=pytest.mark.long) for one in [(3, 3_000, 1), (4, 300, 10), (5, 3_000, 10)]),
    ],
)
def test_verdicts_after_kills_are_those_without(alpha, samples, undisturbed, tmp_path, seed, away, gather):
    quarter = len(samples) // 4
    cuts = [
        int(cut) + quarter * k for k, cut in enumerate(np.random.default_rng(seed).integers(1_000, quarter - away, 4))
    ]
    told = asyncio.run(verdicts_of_killed(alpha, samples, tmp_path, cuts, away, gather))
    assert {verdict.state for verdict in undisturbed} >= {"learning", "normal", "pump_fault"}
    assert sorted(told, key=key) == sorted(undisturbed, key=key)


def test_nor_does_a_kill_after_the_clock_of_the_station_was_set_back_change_them(alpha, samples, tmp_path):
    set_at, cut = 8 * 3_600, 8 * 3_600 + 1_300
    hour_ns = 3_600 * NS_PER_S
    stepped = samples[:set_at] + [
        sample.model_copy(update={"time": sample.time - hour_ns}) for sample in samples[set_at:]
    ]
    told = asyncio.run(verdicts_of_killed(alpha, stepped, tmp_path, [cut], 50))
    assert sorted(told, key=key) == sorted(judged(alpha, stepped), key=key)


def test_a_historian_that_comes_back_later_than_the_detector_is_waited_for(
    alpha, samples, undisturbed, tmp_path, monkeypatch
):
    """As after a restart of the machine: what publishers keep no more is taken from it as soon as it answers."""
    monkeypatch.setattr("wetwell.services.detector.backfill.ASK_AGAIN_S", 0.001)
    cut, back = 20_000, 24_000

    async def live() -> list[Verdict]:
        with MemoryBus() as bus:
            verdicts = bus.subscribe(verdict_key("alpha"), capacity=100_000)
            store = FolderStore(tmp_path / "history", keep_live_days=1)
            historian = Historian(store)
            send = source(bus, historian, samples, 1)
            judge = StationDetector(bus, alpha, checkpoint=checkpoint_in(tmp_path, "alpha"))
            judge.judge(samples[:cut])
            judge.keep()
            for number in range(back):
                send(number)
            judge = StationDetector(bus, alpha, checkpoint=checkpoint_in(tmp_path, "alpha"))
            running = asyncio.create_task(Intake(bus, [judge]).run())
            await asyncio.sleep(0.05)
            assert judge.detector.seen_until_ns == samples[cut - 1].time, "nothing is passed over meanwhile"
            answering = asyncio.create_task(answer(bus.answer(history_key("*")), historian))
            for number in range(back, len(samples)):
                send(number)
            while judge.detector.seen_until_ns < samples[-1].time:  # noqa: ASYNC110 - it ends its work
                await asyncio.sleep(0.001)
            for task in (running, answering):
                task.cancel()
            store.close()
            return list({payload: Verdict.decode(payload) for payload in await verdicts.receive()}.values())

    assert sorted(asyncio.run(live()), key=key) == sorted(undisturbed, key=key)


@pytest.mark.parametrize("known", [0, 1])
def test_of_a_gateway_that_starts_anew_all_is_judged_once_and_in_its_order(
    alpha, samples, tmp_path, monkeypatch, known
):
    """Its clock is an hour ahead, and set back after its first sample; of the one before the historian has some."""
    cut, ahead_ns = 1_000, 3_600 * NS_PER_S
    lost = samples[cut : cut + 100]
    kept = numbered_anew(samples[cut + 100 : cut + 200])
    kept[0] = kept[0].model_copy(update={"time": kept[0].time + ahead_ns})
    known_before = [*samples[:cut], *(lost if known else []), *kept[:known]]
    given = given_after(alpha, tmp_path, monkeypatch, known_before, samples[:cut] + lost, kept)
    assert given == [stamp_of(one) for one in (kept[1:] if known else lost + kept)]


def test_what_was_dropped_as_too_far_ahead_is_not_judged_once_more(alpha, samples, tmp_path, monkeypatch):
    """Nor is what a late historian tells only now of the time before that: one that never stopped had none of it."""
    cut, anew, end = 1_000, 2_000, 2_100
    ahead = numbered_anew(samples[anew:end])
    kept = numbered_anew(samples[end : end + 50])
    historian_has = samples[: cut + 100] + ahead
    given = given_after(alpha, tmp_path, monkeypatch, [*samples[:cut], *ahead[:3]], historian_has, kept)
    assert given == [stamp_of(one) for one in ahead[3:] + kept]


def numbered_anew(samples: list[Sample]) -> list[Sample]:
    """As a gateway sends them that has just begun."""
    return [one.model_copy(update={"seq": number}) for number, one in enumerate(samples)]


def given_after(
    alpha, folder: Path, monkeypatch, known: list[Sample], stored: list[Sample], kept: list[Sample]
) -> list[tuple[int, int]]:
    """What a judge that knew some samples is given when it begins: of those stored, and those that the bus keeps."""
    given: list[tuple[int, int]] = []

    async def live() -> None:
        with MemoryBus() as bus:
            store = FolderStore(folder / "history", keep_live_days=1)
            historian = Historian(store)
            asyncio.create_task(answer(bus.answer(history_key("*")), historian))  # noqa: RUF006 - ends with the loop
            for sample in stored:
                historian.handle("samples", sample.encode())
            send = source(bus, historian, kept, 1)
            for number in range(len(kept)):
                send(number)
            judge = StationDetector(bus, alpha, checkpoint=checkpoint_in(folder, "alpha"))
            judge.judge(known)
            judge.keep()
            judge = StationDetector(bus, alpha, checkpoint=checkpoint_in(folder, "alpha"))
            monkeypatch.setattr(judge, "_judge", lambda sample: given.append(stamp_of(sample)))
            intake = Intake(bus, [judge])
            running = asyncio.create_task(intake.run())
            while intake.is_behind(judge):  # noqa: ASYNC110 - it ends its work
                await asyncio.sleep(0.001)
            running.cancel()
            store.close()

    asyncio.run(live())
    return given


def test_messages_that_wait_share_one_bound_in_bytes():
    room = Room(most_bytes=100)
    first, second = Waiting(room), Waiting(room)
    first.extend([b"x" * 40] * 2, Sample)
    second.extend([b"y" * 30, b"z" * 10], Sample)
    assert (len(first.messages), room.dropped) == (2, 1)
    assert [payload for payload, _ in second.messages] == [b"z" * 10]
    first.pop()
    second.extend([b"y" * 30], Sample)
    assert room.dropped == 1


def key(verdict: Verdict) -> tuple[int, int, str]:
    return verdict.time, verdict.pump, verdict.state
