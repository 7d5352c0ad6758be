"""The historian daemon: after damage it takes anew what publishers still keep; a long answer waits alone."""

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest import mock

from memory_bus import MemoryBus
from virtual_loop import run_virtual

from wetwell.protocols.bus.interface import Publisher
from wetwell.protocols.bus.keys import history_key, sample_key
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian import daemon
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.runtime.settings import HistorianSettings, Settings

SAMPLES = 400
PAGE = 4096


def damage(path: Path) -> None:
    """Empty the pages in the middle."""
    content = bytearray(path.read_bytes())
    middle = len(content) // 2 // PAGE * PAGE
    content[middle : middle + 2 * PAGE] = bytes(2 * PAGE)
    path.write_bytes(content)


def sample(number: int) -> bytes:
    """The sample of a second, as it is sent."""
    return Sample(station="alpha", seq=number, time=number * NS_PER_S, pumps=()).encode()


def on_bus(bus: MemoryBus) -> contextlib.AbstractContextManager[object]:
    """Have the daemon connect to a bus in this process."""

    async def connected(_settings: Settings) -> contextlib.AbstractContextManager[MemoryBus]:
        return contextlib.nullcontext(bus)

    return mock.patch.object(daemon, "connect", connected)


def test_what_was_lost_comes_again_from_the_publishers(tmp_path, caplog):
    caplog.set_level(logging.WARNING)
    settings = Settings(historian=HistorianSettings(folder=tmp_path))
    path = tmp_path / "live.sqlite"

    async def live() -> None:
        publisher = bus.publisher(sample_key("alpha"), history=600)
        running = asyncio.create_task(daemon._run(settings))
        for number in range(SAMPLES):
            publisher.put(sample(number))
        await asyncio.sleep(5.0)
        with contextlib.closing(FolderStore(tmp_path)) as store:
            store.file._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        damage(path)
        await asyncio.sleep(60.0)  # looks through what it has kept
        for number in range(SAMPLES, SAMPLES + 2):
            publisher.put(sample(number))
            await asyncio.sleep(60.0)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    with MemoryBus() as bus, on_bus(bus):
        run_virtual(live())
    with contextlib.closing(FolderStore(tmp_path)) as store:
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(SAMPLES + 2))
    assert (tmp_path / "live.sqlite.refused-1").exists()
    assert "what was lost is taken from the publishers" in caplog.text


@contextlib.contextmanager
def kept_through(folder: Path, happen: Callable[[FolderStore, Publisher], None]) -> Iterator[FolderStore]:
    """The store of a daemon that has got samples, a minute after what happens then; nobody looks for an hour."""
    settings = Settings(historian=HistorianSettings(folder=folder, maintain_s=3_600.0))

    async def live() -> None:
        publisher = bus.publisher(sample_key("alpha"), history=600)
        running = asyncio.create_task(daemon._run(settings))
        for number in range(SAMPLES):
            publisher.put(sample(number))
        await asyncio.sleep(5.0)
        happen(store, publisher)
        await asyncio.sleep(60.0)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    with contextlib.closing(FolderStore(folder)) as store, MemoryBus() as bus:
        opened = mock.patch.object(daemon, "open_store", return_value=contextlib.nullcontext(store))
        with opened, on_bus(bus):
            run_virtual(live())
        yield store


def test_where_the_writer_mends_a_row_what_publishers_keep_comes_again(tmp_path):
    """The disk has changed another row too, which the writer does not remember."""

    def happen(store: FolderStore, publisher: Publisher) -> None:
        store.file._writer.execute("UPDATE sample SET quality = quality + 1 WHERE seq = 300")
        store.file.refused.note("sample", 1, 7 * NS_PER_S, 7)  # it was another one on the disk
        publisher.put(sample(SAMPLES))

    with kept_through(tmp_path, happen) as store:
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(SAMPLES + 1))


def test_what_a_question_finds_damaged_comes_again_though_nobody_sends_anything_new(tmp_path):
    def happen(store: FolderStore, _: Publisher) -> None:
        store.file._writer.execute("UPDATE sample SET quality = quality + 1 WHERE seq = 300")
        assert len(store.samples("alpha", 0, 2**62)) == SAMPLES - 1

    with kept_through(tmp_path, happen) as store:
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(SAMPLES))
        assert store.file._writer.execute("SELECT origin FROM refused").fetchall() == [("sample",)]


class Thinking:
    """A historian that answers about the station "long" when it is told to."""

    def __init__(self) -> None:
        self.may_answer = threading.Event()

    def answer(self, station: str, payload: bytes) -> bytes:
        assert station != "long" or self.may_answer.wait(60.0)
        return station.encode() + payload


def test_a_long_answer_does_not_hold_up_the_others() -> None:
    async def asked() -> tuple[list[bytes], list[bytes]]:
        historian = Thinking()
        answering = asyncio.create_task(daemon._answer(historian, bus.answer(history_key("*"))))
        long = asyncio.create_task(bus.ask(history_key("long"), b"?", timeout_s=60.0))
        quick = await bus.ask(history_key("quick"), b"!", timeout_s=60.0)
        assert not long.done()
        historian.may_answer.set()
        answers = await long, quick
        answering.cancel()
        return answers

    with MemoryBus() as bus:
        assert asyncio.run(asked()) == ([b"long?"], [b"quick!"])
