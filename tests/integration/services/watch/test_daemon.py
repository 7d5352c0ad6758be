"""The watch on a bus with a historian: the days that are over, the same as from disk, over a restart, without one."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import gap_key, history_key
from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.protocols.timestamps import NS_PER_DAY, NS_PER_S
from wetwell.services.batch.watch.history import watch_history
from wetwell.services.historian.answers import answer
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import Batch
from wetwell.services.stations import find_scenario, find_station
from wetwell.services.watch.daemon import WatchService
from wetwell.services.watch.station_watcher import StationWatcher
from wetwell.simulator.simulation import Simulation

ALPHA = find_station("alpha")
DAYS_S = 2 * 86_400 + 60


def no_gap(*_):
    """A diagnosis that finds nothing: what one finds is tested where the watch itself is."""
    return SimpleNamespace(verdict="none")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    recording = Simulation(ALPHA, find_scenario("nominal"), 984_000).advance(DAYS_S, truth=False)
    store = FolderStore(tmp_path_factory.mktemp("history"))
    store.write(Batch(samples=Samples.of_recording(recording).rows("alpha")))
    yield store
    store.close()


@pytest.fixture(scope="module")
def from_disk(store, tmp_path_factory):
    return watch_history(store, ALPHA, tmp_path_factory.mktemp("state"), no_gap)


def looked(store, folder, rounds=1, diagnosed=no_gap, stations=(ALPHA,)):
    """Messages of a watch that looks so often at what a historian has, and the watch."""

    async def run():
        bus = MemoryBus()
        service = WatchService(bus, [StationWatcher(each, folder, diagnosed) for each in stations], pool)
        heard = bus.subscribe(gap_key("*"))
        service.publish_all()
        questions = bus.answer(history_key("*"))

        async def historian():
            while True:
                for request in await questions.receive():
                    station = request.key.split("/")[1]
                    request.reply(answer(store, station, request.payload).encode())

        telling = asyncio.create_task(historian())
        for _ in range(rounds):
            await service.look(1)
        telling.cancel()
        return [GapWatch.decode(payload) for payload in heard._messages], service

    with ThreadPoolExecutor(1) as pool:
        return asyncio.run(run())


def test_each_day_that_is_over_is_told_and_the_bus_tells_what_the_disk_does(store, from_disk, tmp_path):
    told, service = looked(store, tmp_path, rounds=2)
    assert len(told) == 2
    assert told[1].time - told[0].time == pytest.approx(NS_PER_DAY, abs=2 * NS_PER_S)
    assert told[1] == from_disk
    figures = service.figures()
    assert (figures["looks"], figures["refused"], figures["behind_days"]) == (2.0, 0.0, 0.0)
    assert service.condition() == ("running", "")


def test_a_watch_that_was_killed_between_two_days_goes_on(store, from_disk, tmp_path):
    class KilledError(Exception):
        pass

    watcher = StationWatcher(ALPHA, tmp_path, no_gap)
    save, looks = watcher._file.save, []

    def killed(state):
        looks.append(state)
        if len(looks) == 2:
            raise KilledError
        save(state)

    watcher._file.save = killed
    span = store.stations()[0]
    first, second = (span.first_ns + day * NS_PER_DAY for day in (0, 1))
    watcher.look((first, second), store.samples("alpha", first, second).recording(3), [])
    due = watcher.due(span.first_ns, span.last_ns)
    rows = store.samples("alpha", *due).recording(3)
    with pytest.raises(KilledError):
        watcher.look(due, rows, [])
    told, service = looked(store, tmp_path)
    assert [message.time for message in told] == [told[0].time, from_disk.time]
    assert told[1] == from_disk
    assert service.figures()["looks"] == 1.0


def test_without_a_historian_it_waits_and_says_so(tmp_path):
    async def run():
        with ThreadPoolExecutor(1) as pool:
            service = WatchService(MemoryBus(), [StationWatcher(ALPHA, tmp_path, no_gap)], pool)
            await service.look(1)
            return service.condition()

    assert asyncio.run(run()) == ("waiting", "the historian does not answer")


def test_a_station_that_the_historian_does_not_know_is_left_alone(store, tmp_path):
    beta = ALPHA.model_copy(update={"name": "beta"})
    told, service = looked(store, tmp_path, stations=(beta,))
    assert told == []
    assert service.condition()[0] == "running"


def test_a_day_in_other_units_is_refused_and_passed_over_when_more_rows_do_not_help(store, tmp_path):
    watcher = StationWatcher(ALPHA, tmp_path, no_gap)
    span = store.stations()[0]
    for days in (1, 2):
        due = watcher.due(span.first_ns, span.last_ns)
        assert due[1] - due[0] == days * NS_PER_DAY
        rows = store.samples("alpha", *due).recording(3)
        in_cm = {name: 100.0 * values if name == "level_m" else values for name, values in rows.columns.items()}
        watcher.look(due, replace(rows, columns=in_cm), [])
        assert "as if in cm" in watcher.state.refused
    assert watcher.message is None
    assert watcher.state.begins_ns == due[1]
    assert StationWatcher(ALPHA, tmp_path, no_gap).state == watcher.state
