import asyncio

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import sample_block_key, sample_key
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.detector.follower import Follower, Room, Waiting, stamp_of


def sample(seq, time_s=None):
    time_ns = (seq if time_s is None else time_s) * NS_PER_S
    return Sample(station="alpha", seq=seq, time=time_ns, level_m=1.0, pumps=(PumpReading(),))


def stamp(seq):
    return seq * NS_PER_S, seq


def waiting(*, begin=10, size=1, count=20):
    made = Waiting(Room())
    samples = [sample(begin + n) for n in range(count)]
    if size == 1:
        made.extend([one.encode() for one in samples], Sample)
    else:
        blocks = [SampleBlock.of(samples[n : n + size]) for n in range(0, count, size)]
        made.extend([block.encode() for block in blocks], SampleBlock)
    return made


@pytest.mark.parametrize("size", [1, 5])
def test_what_was_judged_before_is_cut_off_and_the_rest_waits(size):
    found = waiting(size=size)
    judged = found.cut(stamp(17))
    assert [one.seq for one in found.samples() if stamp_of(one) not in judged] == list(range(18, 30))
    assert found.cut(stamp(17)) == judged  # asked again it is the same
    assert found.taken == (7 if size == 1 else 1)


@pytest.mark.parametrize("size", [1, 5])
@pytest.mark.parametrize("last", [3, 9, 30, 100])
def test_a_last_sample_that_does_not_wait_cuts_nothing(size, last):
    found = waiting(size=size)
    assert found.cut(stamp(last)) is None
    assert len(list(found.samples())) == 20


def test_of_a_sample_that_was_sent_twice_the_later_place_counts():
    found = waiting(count=3)
    found.extend([sample(11).encode(), sample(13).encode()], Sample)
    assert found.cut(stamp(11)) == {stamp(11)}
    assert [one.seq for one in found.samples()] == [11, 13]


def test_publishers_that_still_send_what_they_keep_are_known():
    assert waiting().is_before(stamp(50))
    assert not waiting().is_before(stamp(20))
    assert Waiting(Room()).is_before(stamp(1))
    set_back = Waiting(Room())
    set_back.extend([sample(60, time_s=5).encode()], Sample)
    assert not set_back.is_before(stamp(50))  # its clock was set back, its numbers go on


def test_who_stands_by_keeps_the_samples_of_the_last_time(monkeypatch):
    clock_s = [0.0]
    monkeypatch.setattr("wetwell.services.detector.follower.time.monotonic", lambda: clock_s[0])

    async def run():
        bus = MemoryBus()
        follower = Follower(bus, ["alpha"], kept_s=10.0)
        publishers = bus.publisher(sample_key("alpha")), bus.publisher(sample_block_key("alpha"))
        following = asyncio.create_task(follower.run())
        for second in range(0, 40, 2):
            clock_s[0] = float(second)
            publishers[0].put(sample(second).encode())
            publishers[1].put(SampleBlock.of([sample(second + 1)]).encode())
            for _ in range(10):
                await asyncio.sleep(0)
        following.cancel()
        return [one.seq for one in follower.waiting["alpha"].samples()]

    assert asyncio.run(run()) == list(range(28, 40))
