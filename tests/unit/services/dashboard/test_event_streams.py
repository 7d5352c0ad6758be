"""Event streams: one encoding for all, no waiting for the slow, an end for everybody."""

import asyncio

from wetwell.services.dashboard.event_streams import QUEUE, RESYNC, EventStreams, event


async def taken(stream, count):
    return [await anext(stream) for _ in range(count)]


def test_everybody_gets_the_same_bytes_after_being_told_to_begin() -> None:
    async def run():
        hub = EventStreams()
        streams = [hub.listen("alpha") for _ in range(3)]
        assert [await anext(stream) for stream in streams] == [RESYNC] * 3
        hub.send("alpha", '{"id":1}')
        hub.send("beta", '{"id":2}')
        got = [await anext(stream) for stream in streams]
        assert got == [event('{"id":1}')] * 3
        assert got[0] is got[1] is got[2]
        hub.close()

    asyncio.run(run())


def test_who_cannot_keep_up_begins_anew_and_nobody_waits() -> None:
    async def run():
        hub = EventStreams()
        slow = hub.listen("alpha")
        assert await anext(slow) == RESYNC
        for number in range(QUEUE + 3):
            hub.send("alpha", str(number))
        assert await taken(slow, 3) == [RESYNC, event(str(QUEUE + 1)), event(str(QUEUE + 2))]
        await slow.aclose()

    asyncio.run(run())


def test_a_browser_that_goes_is_forgotten() -> None:
    async def run():
        hub = EventStreams()
        stream = hub.listen("alpha")
        await anext(stream)
        assert hub.clients == 1
        await stream.aclose()
        assert hub.clients == 0

    asyncio.run(run())


def test_closing_ends_the_streams_after_what_waits_and_lets_nobody_in() -> None:
    async def run():
        hub = EventStreams()
        stream = hub.listen("alpha")
        await anext(stream)
        hub.send("alpha", "1")
        hub.close()
        assert [data async for data in stream] == [event("1")]
        assert [data async for data in hub.listen("alpha")] == []

    asyncio.run(run())
