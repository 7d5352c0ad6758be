"""The historian on a real bus: what is published is kept, what is asked is answered."""

import asyncio
import contextlib
from pathlib import Path

from ports import free_port

from wetwell.protocols.bus.keys import history_key, sample_block_key, sample_key
from wetwell.protocols.bus.zenoh.link import open_client, open_router
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.daemon import keep
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore


def endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


async def over_zenoh(folder: Path) -> None:
    place = endpoint()
    with open_router(place), open_client(place) as station, open_client(place) as site, open_client(place) as asker:
        publisher = station.publisher(sample_key("alpha"), history=600)
        of_blocks = station.publisher(sample_block_key("alpha"), history=60)
        samples = [
            Sample(station="alpha", seq=seq, time=seq * NS_PER_S, level_m=float(seq), pumps=(PumpReading(),))
            for seq in range(200)
        ]

        def put(begin: int) -> None:
            for sample in samples[begin : begin + 50]:
                publisher.put(sample.encode())
            for first in range(begin + 50, begin + 100, 10):
                of_blocks.put(SampleBlock.of(samples[first : first + 10]).encode())

        put(0)  # before anybody listens
        with contextlib.closing(FolderStore(folder)) as store:
            keeping = asyncio.create_task(keep(site, Historian(store), 0.05, 60.0, 60.0))
            put(100)
            question = HistoryQuery(kind="samples", raw=True).encode()
            async with asyncio.timeout(20.0):
                while True:
                    answers = await asker.ask(history_key("alpha"), question)
                    if answers and len(History.decode(answers[0]).time) == len(samples):
                        break
                    await asyncio.sleep(0.05)
            keeping.cancel()
            await asyncio.gather(keeping, return_exceptions=True)
        (answer,) = map(History.decode, answers)
        assert answer.columns["level_m"] == tuple(float(seq) for seq in range(200))


def test_samples_and_blocks_from_before_and_after_its_start_are_kept_and_asked_for_over_zenoh(tmp_path: Path) -> None:
    asyncio.run(over_zenoh(tmp_path))
