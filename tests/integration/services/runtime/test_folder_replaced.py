"""A folder that is replaced while a daemon works in it: the daemon ends, and leaves the new one alone."""

import asyncio
import contextlib
import shutil

import pytest
from memory_bus import MemoryBus
from virtual_loop import run_virtual

from wetwell.protocols.bus.keys import sample_key
from wetwell.protocols.errors import ConfigError
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.station.station_file import Station
from wetwell.services.alarms.daemon import keep_alone
from wetwell.services.detector.daemon import judge_alone
from wetwell.services.historian import daemon as historian_daemon
from wetwell.services.historian.store.interface import StoreError
from wetwell.services.runtime.folder_lock import CHECK_S
from wetwell.services.runtime.settings import AlarmSettings, DetectorSettings, HistorianSettings, Settings

SETTINGS = {
    "alarms": lambda folder: Settings(alarms=AlarmSettings(state_dir=folder)),
    "detector": lambda folder: Settings(detector=DetectorSettings(state_dir=folder)),
    "historian": lambda folder: Settings(historian=HistorianSettings(folder=folder)),
}


async def work(name: str, settings: Settings, bus: MemoryBus, station: Station) -> None:
    match name:
        case "alarms":
            await keep_alone(settings, bus, [station])
        case "detector":
            await judge_alone(settings, bus, [station])
        case _:
            await historian_daemon._run(settings)


@pytest.mark.parametrize("name", SETTINGS)
def test_a_daemon_whose_folder_is_replaced_ends_and_saves_nothing_over_the_new_one(
    name, tmp_path, monkeypatch, alpha
):
    folder, backup = tmp_path / "state", tmp_path / "backup"

    async def connected(_: Settings) -> contextlib.AbstractContextManager[MemoryBus]:
        return contextlib.nullcontext(bus)

    def content() -> dict[str, bytes]:
        return {file.name: file.read_bytes() for file in folder.iterdir()}

    async def live() -> None:
        publisher = bus.publisher(sample_key("alpha"), history=10)
        running = asyncio.create_task(work(name, SETTINGS[name](folder), bus, alpha))
        publisher.put(Sample(station="alpha", seq=0, time=0, pumps=()).encode())
        await asyncio.sleep(CHECK_S / 2)
        shutil.copytree(folder, backup, ignore=shutil.ignore_patterns("*-shm"))
        shutil.rmtree(folder)
        shutil.copytree(backup, folder)
        before = content()
        publisher.put(Sample(station="alpha", seq=1, time=10**9, pumps=()).encode())
        await asyncio.wait([running], timeout=2 * CHECK_S)
        assert running.done()
        assert content() == before
        await running

    monkeypatch.setattr(historian_daemon, "connect", connected)
    with MemoryBus() as bus, pytest.raises(ExceptionGroup) as told:
        run_virtual(live())
    assert told.group_contains((ConfigError, StoreError), match="its lock is gone")
