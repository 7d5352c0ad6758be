"""Event streams: one encoding for all, no waiting for the slow, an end for everybody."""

import asyncio

from wetwell.services.dashboard.event_streams import QUEUE, RESYNC, EventStreams, event


async def taken(stream, count):
    return [await anext(stream) for _ in range(count)]


def test_everybody_gets_the_same_bytes_after_being_told_to_begin() -> None:
    async def run():
        event_streams = EventStreams()
        streams = [event_streams.listen("alpha") for _ in range(3)]
        assert [await anext(stream) for stream in streams] == [RESYNC] * 3
        event_streams.send("alpha", '{"id":1}')
        event_streams.send("beta", '{"id":2}')
        got = [await anext(stream) for stream in streams]
        assert got == [event('{"id":1}')] * 3
        assert got[0] is got[1] is got[2]
        event_streams.close()

    asyncio.run(run())


def test_who_cannot_keep_up_begins_anew_and_nobody_waits() -> None:
    async def run():
        event_streams = EventStreams()
        slow = event_streams.listen("alpha")
        assert await anext(slow) == RESYNC
        for number in range(QUEUE + 3):
            event_streams.send("alpha", str(number))
        assert await taken(slow, 3) == [RESYNC, event(str(QUEUE + 1)), event(str(QUEUE + 2))]
        await slow.aclose()

    asyncio.run(run())


def test_a_browser_that_goes_is_forgotten() -> None:
    async def run():
        event_streams = EventStreams()
        stream = event_streams.listen("alpha")
        await anext(stream)
        assert event_streams.clients == 1
        await stream.aclose()
        assert event_streams.clients == 0

    asyncio.run(run())


def test_closing_ends_the_streams_after_what_waits_and_lets_nobody_in() -> None:
    async def run():
        event_streams = EventStreams()
        stream = event_streams.listen("alpha")
        await anext(stream)
        event_streams.send("alpha", "1")
        event_streams.close()
        assert [data async for data in stream] == [event("1")]
        assert [data async for data in event_streams.listen("alpha")] == []

    asyncio.run(run())
