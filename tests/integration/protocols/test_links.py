"""What every `Bus` does, whichever link it goes through."""

import asyncio
import contextlib
import threading
from collections.abc import Iterator

import pytest
from memory_bus import MemoryBus
from ports import free_port

from wetwell.protocols.bus.interface import Bus, Presence, Publisher, Subscription
from wetwell.protocols.bus.zenoh.link import open_client, open_router

Pair = tuple[Bus, Bus]


@pytest.fixture(params=["memory", "one_zenoh_router", "router_to_client", "client_to_router", "client_to_client"])
def buses(request: pytest.FixtureRequest) -> Iterator[Pair]:
    """The bus that publishes and the bus that subscribes."""
    if request.param == "memory":
        bus = MemoryBus()
        yield bus, bus
        return
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with contextlib.ExitStack() as stack:
        router = stack.enter_context(open_router(endpoint))
        if request.param == "one_zenoh_router":
            yield router, router
            return
        here, there = (
            router if end == "router" else stack.enter_context(open_client(endpoint))
            for end in request.param.split("_to_")
        )
        yield here, there


def collect(subscription: Subscription[bytes], count: int) -> list[bytes]:
    """`count` different messages, without doubles, or more; fails if they do not come."""

    async def receive() -> list[bytes]:
        got: dict[bytes, None] = {}
        async with asyncio.timeout(20):
            while len(got) < count:
                got |= dict.fromkeys(await subscription.receive())
        return list(got)

    return asyncio.run(receive())


def put_until_it_comes(publisher: Publisher, payload: bytes, subscription: Subscription[bytes]) -> list[bytes]:
    """Everything received up to the first arrival of `payload`, which is put again until then."""

    async def receive() -> list[bytes]:
        got: list[bytes] = []
        async with asyncio.timeout(20):
            while payload not in got:
                publisher.put(payload)
                with contextlib.suppress(TimeoutError):
                    got += await asyncio.wait_for(subscription.receive(), 0.1)
        return got

    return asyncio.run(receive())


def test_messages_come_in_order_without_recovery_too(buses):
    here, there = buses
    subscription = there.subscribe("wetwell/*/sample", recover=False)
    publisher = here.publisher("wetwell/alpha/sample", history=5)
    put_until_it_comes(publisher, b"first", subscription)
    numbers = [str(number).encode() for number in range(20)]
    for payload in numbers[:-1]:
        publisher.put(payload)
    got = put_until_it_comes(publisher, numbers[-1], subscription)
    assert [payload for payload in got if payload != b"first"][:20] == numbers


def test_messages_come_in_order(buses):
    here, there = buses
    subscription = there.subscribe("wetwell/*/sample", history=200)
    publisher = here.publisher("wetwell/alpha/sample", history=200)
    sent = [b"%d" % number for number in range(200)]
    publisher.put(sent[0])
    assert collect(subscription, 1) == sent[:1]
    for payload in sent[1:]:
        publisher.put(payload)
    assert collect(subscription, 199) == sent[1:]
    assert subscription.dropped == 0


def test_late_joiner_gets_the_kept_messages(buses):
    here, there = buses
    early = there.subscribe("wetwell/alpha/sample", history=8)
    publisher = here.publisher("wetwell/alpha/sample", history=5)
    for number in range(8):
        publisher.put(b"%d" % number)
        assert collect(early, 1) == [b"%d" % number]  # none is on the way any more when the late ones join
    assert collect(there.subscribe("wetwell/alpha/sample", history=600), 5) == [b"3", b"4", b"5", b"6", b"7"]
    assert collect(there.subscribe("wetwell/alpha/sample", history=2), 2) == [b"6", b"7"]


def test_kept_messages_of_several_keys_come_each(buses):
    here, there = buses
    for pump in (1, 2, 3):
        here.publisher(f"wetwell/alpha/verdict/{pump}").put(b"%d" % pump)
    assert sorted(collect(there.subscribe("wetwell/alpha/verdict/*", history=1), 3)) == [b"1", b"2", b"3"]


def test_without_history_only_new_messages_come(buses):
    here, there = buses
    publisher = here.publisher("wetwell/alpha/sample", history=10)
    for payload in (b"older", b"old"):
        publisher.put(payload)
    assert collect(there.subscribe("wetwell/alpha/sample", history=10), 2) == [b"older", b"old"]
    subscription = there.subscribe("wetwell/alpha/sample")
    assert set(put_until_it_comes(publisher, b"new", subscription)) == {b"new"}


def test_only_the_keys_of_the_expression_come(buses):
    here, there = buses
    one_chunk = there.subscribe("wetwell/*/sample", history=10)
    any_chunks = there.subscribe("wetwell/**", history=10)
    keys = ("wetwell/alpha/sample", "wetwell/beta/sample", "wetwell/alpha/verdict/1", "other/alpha/sample")
    for key in keys:
        here.publisher(key).put(key.encode())
    here.publisher("wetwell/last/sample").put(b"last")
    samples = set(collect(one_chunk, 3))
    assert samples == {b"wetwell/alpha/sample", b"wetwell/beta/sample", b"last"}
    assert set(collect(any_chunks, 4)) == samples | {b"wetwell/alpha/verdict/1"}


def test_a_full_subscription_loses_nothing_silently(buses):
    here, there = buses
    small = there.subscribe("wetwell/alpha/sample", history=50, capacity=3)
    publisher = here.publisher("wetwell/alpha/sample", history=50)
    publisher.put(b"first")
    assert collect(small, 1) == [b"first"]
    for number in range(20):
        publisher.put(b"%d" % number)
    got = collect(small, 1)
    while got[-1] != b"19":
        got += collect(small, 1)
    assert got == [b"%d" % number for number in range(20 - len(got), 20)]
    assert len(got) + small.dropped + small.missed == 20


def test_any_thread_may_publish(buses):
    here, there = buses
    subscription = there.subscribe("wetwell/*/sample", history=100)
    publishers = [here.publisher(f"wetwell/{name}/sample", history=100) for name in ("a", "b")]

    for publisher, payload in zip(publishers, (b"a0", b"b0"), strict=True):
        publisher.put(payload)
    assert set(collect(subscription, 2)) == {b"a0", b"b0"}

    def send(publisher: Publisher, name: bytes) -> None:
        for number in range(1, 100):
            publisher.put(b"%s%d" % (name, number))

    threads = [threading.Thread(target=send, args=pair) for pair in zip(publishers, (b"a", b"b"), strict=True)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    got = collect(subscription, 198)
    assert [payload for payload in got if payload.startswith(b"a")] == [b"a%d" % number for number in range(1, 100)]
    assert [payload for payload in got if payload.startswith(b"b")] == [b"b%d" % number for number in range(1, 100)]


def test_every_subscription_gets_every_message(buses):
    here, there = buses
    subscriptions = [there.subscribe("wetwell/alpha/status/*", history=1) for _ in range(3)]
    here.publisher("wetwell/alpha/status/plc").put(b"{}")
    assert [collect(subscription, 1) for subscription in subscriptions] == [[b"{}"]] * 3


def test_open_bus_is_connected(buses):
    here, there = buses
    assert here.is_connected
    assert there.is_connected


def test_history_below_one_is_refused(buses):
    here, _ = buses
    with pytest.raises(ValueError, match="history must be at least 1, got 0"):
        here.publisher("wetwell/alpha/sample", history=0)


def test_question_is_answered_by_who_answers_its_key(buses):
    here, there = buses

    async def talk() -> list[bytes]:
        requests = here.answer("wetwell/*/history")
        async with asyncio.timeout(20):
            while True:  # a question that comes before the announcement has spread gets no answer
                asking = asyncio.create_task(there.ask("wetwell/alpha/history", b"how many?", timeout_s=10.0))
                receiving = asyncio.create_task(requests.receive())
                await asyncio.wait([asking, receiving], return_when=asyncio.FIRST_COMPLETED)
                if receiving.done():
                    for request in receiving.result():
                        request.reply(request.key.encode() + b" " + request.payload)
                    return await asking
                receiving.cancel()

    assert asyncio.run(talk()) == [b"wetwell/alpha/history how many?"]


def test_question_to_nobody_gives_no_answer(buses):
    _, there = buses
    assert asyncio.run(there.ask("wetwell/nobody/history", timeout_s=0.2)) == []


def test_answer_that_does_not_come_is_not_waited_for(buses):
    here, there = buses
    requests = here.answer("wetwell/alpha/history")
    assert asyncio.run(there.ask("wetwell/alpha/history", timeout_s=0.2)) == []
    assert requests is not None


def test_question_gets_the_last_message_of_a_publisher(buses):
    here, there = buses
    publisher = here.publisher("wetwell/alpha/verdict/1")
    early = there.subscribe("wetwell/alpha/verdict/1", history=1)
    publisher.put(b"normal")
    assert collect(early, 1) == [b"normal"]
    assert set(asyncio.run(there.ask("wetwell/alpha/verdict/*"))) == {b"normal"}


def test_watch_shows_who_lives_and_who_comes(buses):
    here, there = buses
    here.announce("wetwell/alpha/alive/detector")
    watch = there.watch("wetwell/*/alive/*")

    async def seen(count: int) -> set[Presence]:
        got: set[Presence] = set()
        async with asyncio.timeout(20):
            while len(got) < count:
                got |= set(await watch.receive())
        return got

    assert asyncio.run(seen(1)) == {Presence("wetwell/alpha/alive/detector", is_alive=True)}
    here.announce("wetwell/beta/alive/detector")
    assert asyncio.run(seen(1)) == {Presence("wetwell/beta/alive/detector", is_alive=True)}
    if here is not there:
        here.close()
        assert {presence.is_alive for presence in asyncio.run(seen(2))} == {False}
