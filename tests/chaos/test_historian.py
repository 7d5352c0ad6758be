"""The historian under kill -9, a full disk and a lost database: what was acknowledged is there, once."""

import asyncio
import contextlib
import os
import random
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from ports import free_port

from wetwell.protocols.bus.keys import history_key, sample_key
from wetwell.protocols.bus.zenoh.link import open_router
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Store, blocks
from wetwell.services.historian.store.live.database import LiveDatabase
from wetwell.services.historian.store.postgres_store import PostgresStore

pytestmark = pytest.mark.check

WRITER = Path(__file__).with_name("history_writer.py")
NOW_NS = 10**18


def sample(number: int, step_ns: int = NS_PER_S) -> Sample:
    pump = PumpReading(flow_m3h=float(number), running=number % 5 > 2)
    return Sample(station="alpha", seq=number, time=number * step_ns, level_m=number / 7, pumps=(pump,))


def take(historian: Historian, numbers: range, step_ns: int = NS_PER_S) -> None:
    for number in numbers:
        historian.handle("samples", sample(number, step_ns).encode())


def kept(store: Store) -> list[int]:
    """Numbers of the samples that a store holds, doubles included; their values are checked."""
    numbers: list[int] = []
    for block in blocks(store, "alpha", 0, 2**62):
        assert np.array_equal(block.values[:, 0], block.seq / 7)
        assert np.array_equal(block.values[:, 3], block.seq)
        numbers += block.seq.tolist()
    return numbers


def test_a_historian_that_is_killed_again_and_again_loses_nothing_acknowledged(tmp_path: Path) -> None:
    chance = random.Random(5)
    acknowledged = 0
    for _ in range(3):
        command = [sys.executable, str(WRITER), str(tmp_path), str(acknowledged)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            for _ in range(chance.randrange(5, 30)):
                acknowledged = int(writer.stdout.readline())
            writer.kill()
            acknowledged = max([acknowledged, *map(int, writer.stdout.read().split("\n")[:-1])])
        store = FolderStore(tmp_path)
        numbers = kept(store)
        store.close()
        assert numbers[:acknowledged] == list(range(acknowledged))
        assert len(set(numbers)) == len(numbers) <= acknowledged + 20
        assert writer.returncode == -9
    assert list(tmp_path.glob("samples/station=alpha/*.parquet"))


async def killed_beside_a_station(folder: Path) -> tuple[History, int]:
    place = f"tcp/127.0.0.1:{free_port()}"
    command = [sys.executable, "-m", "wetwell.services", "historian", "--data", str(folder), "--zenoh", place]
    question = HistoryQuery(kind="samples", raw=True, points=2000)
    with open_router(place) as bus:
        publisher = bus.publisher(sample_key("alpha"), history=600)

        async def kept(number: int) -> History:
            async with asyncio.timeout(60.0):
                while True:
                    answers = await bus.ask(history_key("alpha"), question.encode(), timeout_s=1.0)
                    if answers and len((history := History.decode(answers[0])).time) >= number:
                        return history
                    await asyncio.sleep(0.05)

        for first in (0, 400):
            historian = await asyncio.create_subprocess_exec(*command)
            try:
                for number in range(first, first + 200):
                    publisher.put(sample(number).encode())
                await kept(first + 200)
            finally:
                historian.kill()
                await historian.wait()
            for number in range(first + 200, first + 400):
                publisher.put(sample(number).encode())  # nobody listens
        historian = await asyncio.create_subprocess_exec(*command)
        try:
            history = await kept(800)
        finally:
            historian.terminate()
        return history, await historian.wait()


def test_a_historian_that_was_killed_gets_what_it_missed_from_the_publishers(tmp_path: Path) -> None:
    history, code = asyncio.run(killed_beside_a_station(tmp_path))
    assert history.columns["seq"] == tuple(map(float, range(800)))
    assert code == 0


UPGRADER = """
import contextlib, os, signal, sqlite3, sys
from pathlib import Path
from wetwell.services.historian.store.live.file import LiveFile

class Killed(sqlite3.Connection):
    def __init__(self, *arguments, **named):
        super().__init__(*arguments, **named)
        self.set_trace_callback(lambda told: sys.argv[2] in told and os.kill(os.getpid(), signal.SIGKILL))

connect = sqlite3.connect
sqlite3.connect = lambda *arguments, **named: connect(*arguments, factory=Killed, **named)
LiveFile(Path(sys.argv[1]), contextlib.nullcontext)
"""


@pytest.mark.parametrize("statement", ["ADD COLUMN last_ns", "COMMIT"])
def test_an_upgrade_that_is_killed_leaves_the_earlier_database(tmp_path: Path, statement: str) -> None:
    path = tmp_path / "live.sqlite"
    store = FolderStore(tmp_path)
    historian = Historian(store)
    take(historian, range(5000))
    historian.commit(NOW_NS)
    store.close()
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.executescript(
            "DROP TRIGGER event_comes; DROP TRIGGER event_goes; DROP TRIGGER event_gets_its_checksum;"
            "DROP TABLE tally; DROP TABLE head;"
            "CREATE TABLE earlier (station INTEGER NOT NULL, time_ns INTEGER NOT NULL, seq INTEGER NOT NULL, "
            "quality INTEGER NOT NULL, data BLOB NOT NULL, PRIMARY KEY (station, time_ns, seq)) WITHOUT ROWID;"
            "INSERT INTO earlier SELECT station, time_ns, seq, quality, data FROM sample;"
            "DROP TABLE sample; ALTER TABLE earlier RENAME TO sample; DROP TABLE refused;"
            "ALTER TABLE hour DROP COLUMN crc; ALTER TABLE event DROP COLUMN crc; PRAGMA user_version = 1"
        )
    killed = subprocess.run([sys.executable, "-c", UPGRADER, str(path), statement], check=False)
    assert killed.returncode == -9
    with contextlib.closing(sqlite3.connect(path)) as database:
        assert database.execute("PRAGMA user_version").fetchone() == (1,)
        assert database.execute("SELECT count(*), max(length(data)) FROM sample").fetchone() == (5000, 56)
        assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    store = FolderStore(tmp_path)
    assert kept(store) == list(range(5000))
    store.close()


class Killed(BaseException):
    """The process would be gone now."""


@pytest.fixture
def die_at(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int], None]]:
    """Let the process "die" before its n-th act on the disk from now on: that act and all later ones do nothing."""
    left = [10**9]

    def deadly(act: Callable[..., object]) -> Callable[..., object]:
        def act_or_die(*arguments: object, **named: object) -> object:
            left[0] -= 1
            if left[0] < 0:
                raise Killed
            return act(*arguments, **named)

        return act_or_die

    for owner, name in ((os, "fsync"), (Path, "replace"), (Path, "unlink"), (Path, "mkdir")):
        monkeypatch.setattr(owner, name, deadly(getattr(owner, name)))
    for name in ("write_hours", "delete_samples", "delete_events", "write"):
        monkeypatch.setattr(LiveDatabase, name, deadly(getattr(LiveDatabase, name)))

    def set_left(acts: int) -> None:
        left[0] = acts

    yield set_left
    left[0] = 10**9


def answers(store: Store) -> list[History]:
    historian = Historian(store)
    questions = [
        {"kind": "samples", "points": 5000, "raw": True},
        {"kind": "samples", "points": 9},
        {"kind": "kpi", "points": 500},
    ]
    asked = (HistoryQuery.model_validate(question).encode() for question in questions)
    return [History.decode(historian.answer("alpha", question)) for question in asked]


@pytest.mark.long
@pytest.mark.parametrize("downsample_after_days", [None, 2])
def test_a_crash_before_any_act_of_the_rollover_loses_nothing_and_doubles_nothing(
    tmp_path: Path, die_at: Callable[[int], None], downsample_after_days: int | None
) -> None:
    store = FolderStore(tmp_path / "whole")
    historian = Historian(store)
    take(historian, range(48), DAY_NS // 12)
    historian.commit(NOW_NS)
    samples, means, kpi = answers(store)
    store.close()
    deaths = 0
    for acts in range(200):
        folder = shutil.copytree(tmp_path / "whole", tmp_path / f"killed-{acts}")
        store = FolderStore(folder, downsample_after_days=downsample_after_days)
        die_at(acts)
        try:
            while store.maintain(NOW_NS):
                pass
            break
        except Killed:
            deaths += 1
        finally:
            die_at(10**9)
            store.close()
        store = FolderStore(folder, downsample_after_days=downsample_after_days)
        for _ in range(2):
            raw_now, means_now, kpi_now = answers(store)
            assert means_now.time == means.time
            assert kpi_now == kpi
            for name in ("level_m", "level_m_min", "level_m_max", "pump1_flow_m3h"):
                assert means_now.columns[name] == pytest.approx(means.columns[name], rel=1e-12)
            if downsample_after_days is None:
                assert raw_now == samples
            while store.maintain(NOW_NS):
                pass
        days = [file for file in folder.glob("*/station=alpha/*.parquet") if file.parts[-3] != "tens"]
        assert len(days) == 2  # beside each the summary of tens of minutes
        store.close()
    assert deaths > 15


def test_on_a_full_disk_samples_wait_and_are_kept_when_there_is_room(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=2m", "none", str(disk)], check=False, capture_output=True
    )
    if mounted.returncode:
        pytest.skip("no small disk: mounting a tmpfs is not allowed here")
    try:
        store = FolderStore(disk / "history")
        historian = Historian(store, spool_rows=20_000)
        take(historian, range(1000))
        assert historian.commit(NOW_NS) == 1000
        ballast = disk / "ballast"
        with pytest.raises(OSError, match="No space left"):
            ballast.write_bytes(bytes(2**21))
        acknowledged = 1000
        for first in range(1000, 12_000, 1000):
            take(historian, range(first, first + 1000))
            acknowledged += historian.commit(NOW_NS)
        figures = historian.figures(NOW_NS)
        assert figures["is_failing"] == 1.0
        assert figures["failed_commits"] >= 5.0
        assert figures["lost"] == 0.0
        assert acknowledged + figures["waiting"] == 12_000
        assert kept(store) == list(range(acknowledged))
        assert not historian.maintain(DAY_NS * 30)
        ballast.unlink()
        assert historian.commit(NOW_NS) == 12_000 - acknowledged
        assert historian.figures(NOW_NS)["is_failing"] == 0.0
        assert kept(store) == list(range(12_000))
        store.close()
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_when_there_is_no_room_for_a_daily_file_the_day_stays_in_the_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = FolderStore(tmp_path)
    historian = Historian(store)
    take(historian, range(240), DAY_NS // 48)
    historian.commit(NOW_NS)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        assert not historian.maintain(NOW_NS)
        assert historian.figures(NOW_NS)["failed_maintenance"] == 1.0
        assert kept(store) == list(range(240))
        assert not list(tmp_path.glob("samples/*/*"))
    while historian.maintain(NOW_NS):
        pass
    assert kept(store) == list(range(240))
    assert len(list(tmp_path.glob("samples/*/*.parquet"))) == 3
    store.close()


def test_a_damaged_database_is_put_aside_and_the_files_are_still_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    store = FolderStore(tmp_path)
    historian = Historian(store)
    take(historian, range(240), DAY_NS // 48)
    historian.commit(NOW_NS)
    while historian.maintain(NOW_NS):
        pass
    store.close()
    (tmp_path / "live.sqlite").write_bytes(b"no database " * 1000)
    store = FolderStore(tmp_path)
    assert "kept as live.sqlite.refused-1, a new one is begun" in caplog.text
    assert kept(store) == list(range(144))
    assert (tmp_path / "live.sqlite.refused-1").read_bytes().startswith(b"no database")
    store.close()


def test_while_the_database_is_away_samples_wait_and_nothing_acknowledged_is_lost(postgres) -> None:
    store = PostgresStore(postgres.url)
    historian = Historian(store, spool_rows=2000)
    before = historian.commit(NOW_NS)
    base = 0 if not kept(store) else max(kept(store)) + 1
    take(historian, range(base, base + 500))
    assert before == 0
    assert historian.commit(NOW_NS) == 500
    postgres.stop()
    try:
        take(historian, range(base + 500, base + 3000))
        assert historian.commit(NOW_NS) == 0
        assert (
            "Connection refused"
            in History.decode(historian.answer("alpha", HistoryQuery(kind="samples").encode())).error
        )
        assert historian.figures(NOW_NS)["lost"] == 500.0
    finally:
        postgres.start()
    assert historian.commit(NOW_NS) == 2000
    assert historian.commit(NOW_NS) == 0
    assert kept(store)[-2500:] == [*range(base, base + 500), *range(base + 1000, base + 3000)]
    store.close()
