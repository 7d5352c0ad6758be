import asyncio
import threading

import pytest

from wetwell.protocols.bus.mailbox import Mailbox


async def waiting_reader(mailbox: Mailbox) -> asyncio.Task[list[bytes]]:
    """A task that has come to wait for a message."""
    reader = asyncio.create_task(mailbox.receive())
    for _ in range(3):
        await asyncio.sleep(0)
    assert mailbox._reader is not None
    return reader


def test_messages_come_in_one_batch_oldest_first():
    mailbox = Mailbox(capacity=3)
    for payload in (b"1", b"2", b"3"):
        mailbox.put(payload)
    assert asyncio.run(mailbox.receive()) == [b"1", b"2", b"3"]
    assert mailbox.dropped == 0


def test_full_mailbox_drops_the_oldest_and_counts():
    mailbox = Mailbox(capacity=2)
    for number in range(5):
        mailbox.put(b"%d" % number)
    assert asyncio.run(mailbox.receive()) == [b"3", b"4"]
    assert mailbox.dropped == 3


def test_bytes_have_a_bound_too_but_the_newest_message_always_has_room():
    mailbox = Mailbox(100, len, most_bytes=10)
    mailbox.extend([b"1234", b"5678", b"90ab"])
    assert mailbox.dropped == 1
    mailbox.put(b"x" * 50)
    assert asyncio.run(mailbox.receive()) == [b"x" * 50]
    assert mailbox.dropped == 3
    mailbox.put(b"1234")
    assert mailbox.dropped == 3, "what was received takes no room"


@pytest.mark.parametrize(("capacity", "most_bytes"), [(4, 1_000), (1_000, 40)])
def test_it_is_crowded_when_half_of_the_room_is_taken(capacity, most_bytes):
    mailbox = Mailbox(capacity, len, most_bytes)
    crowded = []
    for _ in range(4):
        mailbox.put(b"x" * 10)
        crowded.append(mailbox.is_crowded)
    assert crowded == [False, False, True, True]


def test_capacity_below_one_is_refused():
    with pytest.raises(ValueError, match="capacity must be at least 1, got 0"):
        Mailbox(capacity=0)


def test_a_waiting_reader_is_woken_from_another_thread():
    async def receive() -> list[bytes]:
        mailbox = Mailbox(capacity=10)
        reader = await waiting_reader(mailbox)
        sender = threading.Thread(target=mailbox.put, args=(b"hello",))
        sender.start()
        batch = await asyncio.wait_for(reader, 10)
        sender.join()
        return batch

    assert asyncio.run(receive()) == [b"hello"]


def test_nothing_is_lost_between_threads():
    count, threads = 5_000, 4
    mailbox = Mailbox(capacity=count * threads)

    def send(name: int) -> None:
        for number in range(count):
            mailbox.put(b"%d/%d" % (name, number))

    async def receive_all() -> list[bytes]:
        senders = [threading.Thread(target=send, args=(name,)) for name in range(threads)]
        for sender in senders:
            sender.start()
        got: list[bytes] = []
        async with asyncio.timeout(30):
            while len(got) < count * threads:
                got += await mailbox.receive()
        for sender in senders:
            sender.join()
        return got

    got = asyncio.run(receive_all())
    for name in range(threads):
        own = [payload for payload in got if payload.startswith(b"%d/" % name)]
        assert own == [b"%d/%d" % (name, number) for number in range(count)]
    assert mailbox.dropped == 0


def test_a_burst_wakes_the_loop_once():
    async def wake_ups() -> tuple[int, list[bytes]]:
        mailbox, loop, calls = Mailbox(capacity=1000), asyncio.get_running_loop(), 0
        plain = loop.call_soon_threadsafe

        def counted(*args, **kwargs):
            nonlocal calls
            calls += 1
            return plain(*args, **kwargs)

        loop.call_soon_threadsafe = counted
        reader = await waiting_reader(mailbox)
        for number in range(1000):
            mailbox.put(b"%d" % number)
        return calls, await reader

    calls, batch = asyncio.run(wake_ups())
    assert calls == 1
    assert len(batch) == 1000


def test_cancelled_reader_loses_no_message():
    async def receive() -> list[bytes]:
        mailbox = Mailbox(capacity=10)
        reader = await waiting_reader(mailbox)
        mailbox.put(b"1")
        reader.cancel()
        with pytest.raises(asyncio.CancelledError):
            await reader
        mailbox.put(b"2")
        return await mailbox.receive()

    assert asyncio.run(receive()) == [b"1", b"2"]


def test_a_second_reader_is_refused():
    async def receive_twice() -> None:
        mailbox = Mailbox(capacity=10)
        reader = await waiting_reader(mailbox)
        try:
            await mailbox.receive()
        finally:
            reader.cancel()

    with pytest.raises(RuntimeError, match="one reader"):
        asyncio.run(receive_twice())


def test_a_busy_sender_does_not_starve_other_tasks():
    async def rounds() -> int:
        mailbox, done = Mailbox(capacity=10), asyncio.Event()
        asyncio.get_running_loop().call_later(0.01, done.set)
        count = 0
        while not done.is_set():
            mailbox.put(b"more")
            count += len(await mailbox.receive())
        return count

    assert asyncio.run(rounds()) > 0


def test_put_after_the_loop_has_ended_is_harmless():
    mailbox, loop = Mailbox(capacity=10), asyncio.new_event_loop()
    mailbox._reader = loop.create_future()
    loop.close()
    mailbox.put(b"late")
    assert asyncio.run(mailbox.receive()) == [b"late"]
