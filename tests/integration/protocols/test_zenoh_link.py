import asyncio
import contextlib
import json
import logging
import queue
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import pytest
import zenoh
from ports import free_port

from wetwell.protocols.bus.interface import Subscription
from wetwell.protocols.bus.zenoh.access import ZenohAccess
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client, open_client, open_router
from wetwell.protocols.errors import ConfigError, LinkError

LIMIT_S = 20.0


@pytest.fixture
def endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture
def router(endpoint: str) -> Iterator[ZenohBus]:
    with open_router(endpoint) as bus:
        yield bus


def plain_client(endpoint: str) -> zenoh.Session:
    """A client that knows nothing of this package."""
    config = {"mode": "client", "connect": {"endpoints": [endpoint]}, "scouting": {"multicast": {"enabled": False}}}
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def wait_until(is_so: Callable[[], bool]) -> float:
    """Seconds until a condition holds; fails if it does not."""
    begin = time.monotonic()
    while not is_so():
        assert time.monotonic() - begin < LIMIT_S, "waited in vain"
        time.sleep(0.005)
    return time.monotonic() - begin


async def receive_until(subscription: Subscription, last: bytes) -> list[bytes]:
    """Messages up to `last`, without doubles."""
    got: dict[bytes, None] = {}
    async with asyncio.timeout(LIMIT_S):
        while last not in got:
            got |= dict.fromkeys(await subscription.receive())
    return list(got)


async def next_batch(subscription: Subscription) -> list[bytes]:
    """What comes soon; empty if nothing does."""
    try:
        return await asyncio.wait_for(subscription.receive(), 0.1)
    except TimeoutError:
        return []


@contextlib.contextmanager
def python(script: str, *args: str) -> Iterator[subprocess.Popen[str]]:
    """A process that runs a script; killed at the end."""
    command = [sys.executable, "-c", script, *args]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.usefixtures("router")
@pytest.mark.parametrize("selector", ["wetwell/alpha/verdict/1", "wetwell/*/verdict/*", "wetwell/**"])
def test_plain_client_gets_the_last_message_as_json(endpoint, selector):
    with open_client(endpoint) as bus, plain_client(endpoint) as plain:
        publisher = bus.publisher("wetwell/alpha/verdict/1", history=3)
        assert list(plain.get(selector)) == []
        for payload in (b'{"seq": 1}', b'{"seq": 2}'):
            publisher.put(payload)
        replies: list[zenoh.Reply] = []
        wait_until(lambda: replies.extend(plain.get(selector)) or replies != [])
        assert len(replies) == 1
        assert replies[0].ok is not None
        assert replies[0].ok.payload.to_bytes() == b'{"seq": 2}'
        assert replies[0].ok.encoding == zenoh.Encoding.APPLICATION_JSON
        assert str(replies[0].ok.key_expr) == "wetwell/alpha/verdict/1"


@pytest.mark.usefixtures("router")
def test_plain_subscriber_sees_the_encoding(endpoint):
    with plain_client(endpoint) as plain, open_client(endpoint) as bus:
        samples: queue.Queue[zenoh.Sample] = queue.Queue()
        subscriber = plain.declare_subscriber("wetwell/*/sample", samples.put)
        publisher = bus.publisher("wetwell/alpha/sample")
        wait_until(lambda: publisher.put(b"{}") or not samples.empty())
        sample = samples.get()
        assert sample.encoding == zenoh.Encoding.APPLICATION_JSON
        assert str(subscriber.key_expr) == "wetwell/*/sample"


@pytest.mark.usefixtures("router")
def test_liveliness_token_comes_and_goes_with_the_bus(endpoint):
    with plain_client(endpoint) as plain:
        changes: queue.Queue[zenoh.Sample] = queue.Queue()
        watch = plain.liveliness().declare_subscriber("wetwell/*/alive/*", changes.put)
        with open_client(endpoint) as bus:
            bus.announce("wetwell/alpha/alive/detector")
            change = changes.get(timeout=LIMIT_S)
            assert (change.kind == zenoh.SampleKind.PUT, str(change.key_expr)) == (
                True,
                "wetwell/alpha/alive/detector",
            )
        assert changes.get(timeout=LIMIT_S).kind == zenoh.SampleKind.DELETE
        assert list(plain.liveliness().get(watch.key_expr)) == []


@pytest.mark.usefixtures("router")
def test_a_router_knows_the_key_on_which_a_publisher_tells_its_last_message(endpoint):
    with plain_client(endpoint) as plain, open_client(endpoint) as bus:
        bus.publisher("wetwell/alpha/verdict/1").put(b"{}")
        wait_until(lambda: list(plain.liveliness().get("wetwell/alpha/verdict/1/@tail")) != [])


def test_router_that_comes_back_loses_nothing(endpoint):
    async def stream() -> list[bytes]:
        with open_router(endpoint) as router, open_client(endpoint) as sender, open_client(endpoint) as reader:
            subscription = reader.subscribe("wetwell/*/sample", history=600)
            publisher = sender.publisher("wetwell/alpha/sample", history=600)
            sender.announce("wetwell/alpha/alive/plc")
            publisher.put(b"0")
            await receive_until(subscription, b"0")
            for number in range(1, 100):
                publisher.put(b"%d" % number)
            await receive_until(subscription, b"99")
            router.close()
            wait_until(lambda: not sender.is_connected and not reader.is_connected)
            for number in range(100, 200):
                publisher.put(b"%d" % number)
            with open_router(endpoint):
                assert wait_until(lambda: sender.is_connected and reader.is_connected) < 5
                recovered = await receive_until(subscription, b"199")
                for number in range(200, 300):
                    publisher.put(b"%d" % number)
                recovered += await receive_until(subscription, b"299")
                with plain_client(endpoint) as plain:
                    (reply,) = plain.get("wetwell/alpha/sample")
                    assert reply.ok is not None
                    assert reply.ok.payload.to_bytes() == b"299"
                    (alive,) = plain.liveliness().get("wetwell/**")
                    assert str(alive.ok and alive.ok.key_expr) == "wetwell/alpha/alive/plc"
                late = reader.subscribe("wetwell/*/sample", history=600)
                assert await receive_until(late, b"299") == [b"%d" % number for number in range(300)]
            return list(dict.fromkeys(recovered))

    assert asyncio.run(stream()) == [b"%d" % number for number in range(100, 300)]


def test_subscription_without_history_misses_nothing_of_a_known_publisher(endpoint):
    async def receive() -> list[bytes]:
        with open_router(endpoint) as router, open_client(endpoint) as sender, open_client(endpoint) as reader:
            publisher = sender.publisher("wetwell/alpha/sample", history=10)
            subscription = reader.subscribe("wetwell/*/sample")
            async with asyncio.timeout(LIMIT_S):
                while not (got := {*await next_batch(subscription)}):
                    publisher.put(b"0")
            router.close()
            wait_until(lambda: not sender.is_connected and not reader.is_connected)
            for payload in (b"1", b"2", b"3"):
                publisher.put(payload)
            with open_router(endpoint):
                return sorted(got | {*await receive_until(subscription, b"3")})

    assert asyncio.run(receive()) == [b"0", b"1", b"2", b"3"]


def test_a_reader_that_is_far_too_slow_loses_nothing_that_publishers_keep(endpoint):
    """Its mailbox has room for 200; the rest stays with the publisher until it reads."""
    want = [b"%05d" % number for number in range(5_000)]

    async def read_late() -> tuple[list[bytes], int]:
        publisher.put(b"first")
        messages = follower.subscribe("wetwell/alpha/sample", history=1, capacity=200)
        assert await asyncio.wait_for(messages.receive(), LIMIT_S) == [b"first"]
        for payload in want:
            publisher.put(payload)
        await asyncio.to_thread(wait_until, lambda: messages.is_crowded)
        got: list[bytes] = []
        async with asyncio.timeout(LIMIT_S):
            while got[-1:] != want[-1:]:
                got += await messages.receive()
        return got, messages.dropped + messages.missed

    with open_router(endpoint), open_client(endpoint) as source, open_client(endpoint) as follower:
        publisher = source.publisher("wetwell/alpha/sample", history=len(want))
        assert asyncio.run(read_late()) == (want, 0)


def test_what_nobody_has_any_more_is_counted_and_told(endpoint, caplog):
    async def read_late() -> int:
        publisher.put(b"first")
        messages = follower.subscribe("wetwell/alpha/sample", history=1, capacity=200)
        assert await asyncio.wait_for(messages.receive(), LIMIT_S) == [b"first"]
        for number in range(5_000):
            publisher.put(b"%05d" % number)
        await asyncio.to_thread(wait_until, lambda: messages.is_crowded)
        got: list[bytes] = []
        async with asyncio.timeout(LIMIT_S):
            while got[-1:] != [b"04999"]:
                got += await messages.receive()
        assert len(got) + messages.missed == 5_000
        return messages.missed

    with open_router(endpoint), open_client(endpoint) as source, open_client(endpoint) as follower:
        publisher = source.publisher("wetwell/alpha/sample", history=50)
        missed = asyncio.run(read_late())
    assert missed > 0
    assert "messages are lost, nobody has them" in caplog.text


def test_a_subscription_says_whether_all_has_come_that_is_kept(endpoint):
    """Its mailbox has room for 200; there is something to come as long as it does not read."""
    want = [b"%05d" % number for number in range(5_000)]

    async def read() -> list[bytes]:
        messages = follower.subscribe("wetwell/alpha/sample", history=len(want), capacity=200)
        assert messages.is_behind
        await asyncio.to_thread(wait_until, lambda: messages.is_crowded)
        assert messages.is_behind
        got: list[bytes] = []
        async with asyncio.timeout(LIMIT_S):
            while got[-1:] != want[-1:]:
                got += await messages.receive()
            await asyncio.to_thread(wait_until, lambda: not messages.is_behind)
        return got

    with open_router(endpoint), open_client(endpoint) as source, open_client(endpoint) as follower:
        publisher = source.publisher("wetwell/alpha/sample", history=len(want))
        for payload in want:
            publisher.put(payload)
        assert asyncio.run(read()) == want


def test_what_is_declared_without_router_works_afterwards(endpoint):
    async def receive() -> list[bytes]:
        with open_router(endpoint) as router, open_client(endpoint) as sender, open_client(endpoint) as reader:
            router.close()
            wait_until(lambda: not sender.is_connected and not reader.is_connected)
            subscription = reader.subscribe("wetwell/*/sample", history=10)
            publisher = sender.publisher("wetwell/alpha/sample", history=10)
            publisher.put(b"1")
            with open_router(endpoint):
                return await receive_until(subscription, b"1")

    assert asyncio.run(receive()) == [b"1"]


@pytest.mark.usefixtures("router")
def test_killed_publisher_is_followed_by_its_successor(endpoint):
    script = """
import sys
from wetwell.protocols.bus.zenoh.link import open_client
with open_client(sys.argv[1]) as bus:
    publisher = bus.publisher("wetwell/alpha/sample", history=10)
    for number in range(3):
        publisher.put(f"{sys.argv[2]}{number}".encode())
        sys.stdin.readline()
    sys.stdin.read()
"""

    async def receive() -> list[bytes]:
        with open_client(endpoint) as bus:
            subscription = bus.subscribe("wetwell/*/sample", history=10)
            got = []
            for name in ("a", "b"):
                with python(script, endpoint, name) as process:
                    got += await receive_until(subscription, f"{name}0".encode())
                    process.stdin.write("\n\n")
                    process.stdin.flush()
                    got += await receive_until(subscription, f"{name}2".encode())
            return got

    assert asyncio.run(receive()) == [b"a0", b"a1", b"a2", b"b0", b"b1", b"b2"]


@pytest.mark.usefixtures("router")
def test_port_in_use_is_told_in_one_line(endpoint):
    with pytest.raises(LinkError) as caught:
        open_router(endpoint)
    assert str(caught.value) == f"cannot listen on {endpoint}: address already in use"


def test_router_that_is_not_there_is_told_in_one_line(endpoint):
    with pytest.raises(LinkError) as caught:
        open_client(endpoint, timeout_s=0.1)
    assert str(caught.value) == f"no router reached at {endpoint} within 0.1 s (wrong credentials look the same)"


@pytest.mark.parametrize("opener", [open_router, open_client, lambda text: asyncio.run(connect_client(text))])
def test_malformed_endpoint_is_a_config_error(opener):
    with pytest.raises(
        ConfigError, match=r"^endpoint must be of the form tcp/ADDRESS:PORT, got '127\.0\.0\.1:7447'$"
    ):
        opener("127.0.0.1:7447")


def test_client_waits_for_its_router_and_logs_each_try(endpoint, caplog):
    async def connect() -> bool:
        connecting = asyncio.create_task(connect_client(endpoint, timeout_s=0.05, longest_wait_s=0.05))
        await asyncio.to_thread(wait_until, lambda: len(caplog.records) >= 2)
        with open_router(endpoint), await asyncio.wait_for(connecting, LIMIT_S) as bus:
            return bus.is_connected

    with caplog.at_level(logging.WARNING):
        assert asyncio.run(connect())
    assert all(record.levelno == logging.WARNING for record in caplog.records)
    assert caplog.messages[0].startswith(f"no router reached at {endpoint} within 0.05 s")
    assert "\n" not in "".join(caplog.messages)


def test_waiting_for_a_router_can_be_cancelled(endpoint):
    async def cancel() -> float:
        loop = asyncio.get_running_loop()
        connecting = asyncio.create_task(connect_client(endpoint, timeout_s=2.0))
        await asyncio.sleep(0)
        begin_s = loop.time()
        connecting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await connecting
        return loop.time() - begin_s

    assert asyncio.run(cancel()) < 1.0


@pytest.mark.usefixtures("router")
def test_bus_that_comes_after_a_cancellation_is_closed(endpoint, monkeypatch):
    opened: queue.Queue[ZenohBus] = queue.Queue()

    async def cancel() -> None:
        loop = asyncio.get_running_loop()
        connecting: asyncio.Task[ZenohBus]

        def slow_open(endpoint: str, access: ZenohAccess, *, timeout_s: float) -> ZenohBus:
            bus = open_client(endpoint, access, timeout_s=timeout_s)
            loop.call_soon_threadsafe(connecting.cancel)
            opened.put(bus)
            wait_until(connecting.cancelled)
            return bus

        monkeypatch.setattr("wetwell.protocols.bus.zenoh.link.open_client", slow_open)
        connecting = asyncio.create_task(connect_client(endpoint))
        with pytest.raises(asyncio.CancelledError):
            await connecting

    asyncio.run(cancel())
    bus = opened.get(timeout=LIMIT_S)
    wait_until(lambda: not bus.is_connected)
    with pytest.raises(LinkError, match="cannot publish"):
        bus.publisher("wetwell/alpha/sample")


@pytest.mark.usefixtures("router")
def test_closed_bus_says_so(endpoint):
    with open_client(endpoint) as bus:
        publisher = bus.publisher("wetwell/alpha/sample")
    bus.close()
    assert not bus.is_connected
    with pytest.raises(LinkError, match=r"^cannot publish on 'wetwell/alpha/sample': session closed$"):
        publisher.put(b"late")


@pytest.mark.parametrize("use", [ZenohBus.publisher, ZenohBus.subscribe, ZenohBus.announce])
def test_wrong_key_is_told_in_one_line(router, use):
    with pytest.raises(LinkError, match=r"'wetwell//sample': .*empty chunks are forbidden[^/]*$"):
        use(router, "wetwell//sample")


@pytest.mark.parametrize("closing", ["router.close()", "client.close()"])
def test_process_that_closes_its_bus_ends_by_itself_and_quietly(endpoint, closing):
    script = f"""
import sys
from wetwell.protocols.bus.zenoh.link import open_client, open_router
with open_router(sys.argv[1]) as router, open_client(sys.argv[1]) as client:
    client.announce("wetwell/alpha/alive/plc")
    subscription = router.subscribe("wetwell/**", history=5)
    client.publisher("wetwell/alpha/sample").put(b"1")
    {closing}
"""
    with python(script, endpoint) as process:
        output, errors = process.communicate(timeout=LIMIT_S)
        assert (process.returncode, output, errors) == (0, "", "")


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_session_has_no_shared_memory_which_a_killed_process_would_leave_behind(endpoint):
    """In a process of its own: others here open sessions as foreign clients do, which have some."""
    script = (
        "import sys; from pathlib import Path\n"
        "from wetwell.protocols.bus.zenoh.link import open_client, open_router\n"
        "with open_router(sys.argv[1]), open_client(sys.argv[1]) as bus:\n"
        "    bus.publisher('wetwell/a/verdict/1', history=1).put(bytes(100_000))\n"
        "    sys.stdout.write(Path('/proc/self/maps').read_text())\n"
    )
    maps = subprocess.run([sys.executable, "-c", script, endpoint], capture_output=True, text=True, check=True).stdout
    assert "libc" in maps
    assert ".zenoh" not in maps
