"""Rows of several samples: where they end, what is refused, and a live database of the version before them."""

import contextlib
import hashlib
import re
import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.rows import HOUR_NS, MAX_DATA_BYTES, SampleRow, pack, pack_block
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.service import Historian
from wetwell.services.historian.spool import Spool
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, DIGEST_BYTES, Batch, StoreError
from wetwell.services.historian.store.live.database import LiveDatabase
from wetwell.services.historian.store.live.file import LiveFile
from wetwell.services.historian.store.live.salvage import damage_of

VERSION_1 = """
CREATE TABLE station (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, first_ns INTEGER, last_ns INTEGER);
CREATE TABLE sample (
    station INTEGER NOT NULL, time_ns INTEGER NOT NULL, seq INTEGER NOT NULL, quality INTEGER NOT NULL,
    data BLOB NOT NULL, PRIMARY KEY (station, time_ns, seq)
) WITHOUT ROWID;
CREATE TABLE event (
    id INTEGER PRIMARY KEY, kind TEXT NOT NULL, station INTEGER NOT NULL, time_ns INTEGER NOT NULL,
    digest BLOB NOT NULL, payload BLOB NOT NULL, UNIQUE (kind, station, time_ns, digest)
);
CREATE TABLE hour (
    station INTEGER NOT NULL, hour_ns INTEGER NOT NULL, data BLOB NOT NULL, PRIMARY KEY (station, hour_ns)
) WITHOUT ROWID;
PRAGMA user_version = 1;
"""


def sample(number: int, pumps: int = 3, step_ns: int = NS_PER_S) -> Sample:
    pump = PumpReading(frequency_hz=50.0, flow_m3h=float(number), running=number % 2 == 0)
    return Sample(
        station="alpha",
        seq=number,
        time=number * step_ns,
        level_m=None if number % 3 == 0 else number / 7,
        pumps=(pump,) * pumps,
    )


def block(*numbers: int, pumps: int = 3) -> SampleBlock:
    return SampleBlock.of([sample(number, pumps) for number in numbers])


def samples_of(rows: list[SampleRow]) -> Samples:
    return Samples.of_rows([(row.time_ns, row.seq, row.size, row.quality, row.data) for row in rows])


def sizes(rows: list[SampleRow]) -> list[int]:
    return [row.size for row in rows]


@pytest.fixture
def live(tmp_path: Path) -> Iterator[LiveDatabase]:
    with contextlib.closing(LiveFile(tmp_path / "live.sqlite", contextlib.nullcontext)) as file:
        yield LiveDatabase(file)


def seqs(live: LiveDatabase) -> list[int]:
    return live.samples("alpha", 0, 2**62).seq.tolist()


def test_a_block_becomes_rows_that_fit_into_a_page_and_are_always_the_same() -> None:
    rows = pack_block(block(*range(10)))
    assert sizes(rows) == [5, 5]
    assert all(len(row.data) <= MAX_DATA_BYTES for row in rows)
    assert rows == pack_block(SampleBlock.decode(block(*range(10)).encode()))
    assert [(row.time_ns, row.seq, row.last_ns) for row in rows] == [
        (0, 0, 4 * NS_PER_S),
        (5 * NS_PER_S, 5, 9 * NS_PER_S),
    ]
    assert set(sizes(pack_block(block(*range(600), pumps=1)))) == {12, 13}
    assert sizes(pack_block(block(*range(3), pumps=30))) == [1, 1, 1]


def test_a_row_ends_where_time_falls_and_at_the_hour() -> None:
    assert sizes(pack_block(block(5, 6, 7, 3, 4))) == [3, 2]
    assert sizes(pack_block(block(3597, 3598, 3599, 3600))) == [3, 1]
    assert sizes(pack_block(block(8, 8, 9))) == [3]
    before = SampleBlock.of(
        [sample(0).model_copy(update={"time": time_ns}) for time_ns in (-HOUR_NS - 1, -HOUR_NS, -1, 0)]
    )
    assert sizes(pack_block(before)) == [1, 2, 1]


def test_a_block_of_one_is_the_row_of_its_sample() -> None:
    assert pack_block(block(4)) == [pack("alpha", sample(4))]


def test_samples_come_out_of_their_rows_as_they_went_in() -> None:
    whole = samples_of(pack_block(block(*range(20))))
    mixed = replace(whole, quality=np.arange(20) // 7 % 3)
    rows = mixed.rows("alpha")
    assert sizes(rows) == [3, 4, 3, 4, 6]
    again = samples_of(rows[::-1])
    for name in ("time_ns", "seq", "quality", "values"):
        assert np.array_equal(getattr(again, name), getattr(mixed, name), equal_nan=True), name
    assert again.values[:, 3].tolist() == list(range(20))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ('"station":"../alpha"', "must be a name of letters"),
        (f'"station":"{"a" * 65}"', "must be a name of letters"),
        ('"time":["1970-01-01T00:00:00Z","2262-04-11T00:00:00Z"]', "lies too far from 1970"),
        ('"time":["1970-01-01T00:00:00Z"]', "time: 1 values, must be 2 as in seq"),
        ('"time":["1970-01-01T00:00:00Z","soon"]', "time"),
        ('"seq":[]', "seq"),
        ('"seq":[1,-1]', "seq"),
        ('"seq":[1,9223372036854775808]', "seq"),
        ('"quality":"fine"', "quality"),
        ('"schema":"wetwell.sample/1"', "schema"),
    ],
)
def test_a_block_that_is_none_is_counted_and_left_out_whole(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, change: str, told: str
) -> None:
    name = change.partition(":")[0]
    payload = re.sub(rf'{name}:(\[[^]]*\]|"[^"]*")', change, block(0, 1).encode().decode(), count=1)
    assert change in payload
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        historian.handle("blocks", payload.encode())
        assert historian.commit(0) == 0
        assert historian.figures(0)["malformed"] == 1.0
    assert told in caplog.text


def test_figures_count_samples(tmp_path: Path) -> None:
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        for payload in (block(*range(10)).encode(), block(*range(10)).encode(), block(20, 21).encode()):
            historian.handle("blocks", payload)
        historian.handle("samples", sample(30).encode())
        assert historian.figures(0)["waiting"] == historian.figures(0)["taken"] == 23.0
        assert historian.commit(31 * NS_PER_S) == 23
        figures = historian.figures(31 * NS_PER_S)
        assert (figures["committed"], figures["doubled"], figures["waiting"]) == (23.0, 10.0, 0.0)
        assert figures["lag_s"] == 1.0


def test_a_spool_gives_up_the_oldest_rows_but_never_the_last() -> None:
    rows = pack_block(block(*range(10))) + pack_block(block(10, 11))
    spool = Spool(6)
    spool.put(rows)
    assert (spool.waiting, spool.lost) == (2, 10)
    spool.put_back(rows[:1])
    assert (spool.waiting, spool.lost) == (2, 15)
    small = Spool(1)
    small.put(rows[:1])
    assert (small.waiting, small.lost) == (5, 0)
    assert small.pop(1) == rows[:1]
    assert (small.waiting, small.pop(1)) == (0, [])


def test_blocks_that_begin_alike_are_both_kept(live: LiveDatabase) -> None:
    assert live.write(Batch(samples=pack_block(block(1, 2, 3)))) == 3
    assert live.write(Batch(samples=pack_block(block(1, 4, 5)))) == 3
    assert live.write(Batch(samples=pack_block(block(1, 2, 3)))) == 0
    assert seqs(live) == [1, 2, 3, 4, 5]


def test_what_came_meanwhile_is_not_deleted(live: LiveDatabase) -> None:
    live.write(Batch(samples=[*pack_block(block(1, 2, 3)), pack("alpha", sample(2))]))
    known = live.samples("alpha", 0, 2**62)
    live.write(Batch(samples=pack_block(block(2, 4))))
    live.delete_samples("alpha", known)
    assert seqs(live) == [2, 4]
    live.delete_samples("alpha", live.samples("alpha", 4 * NS_PER_S, 2**62))
    assert seqs(live) == [2, 4]
    live.delete_samples("alpha", live.samples("alpha", 0, 2**62))
    assert seqs(live) == []


def of_version_1(path: Path, rows: int) -> None:
    """A live database as the version before wrote it, in the state of a historian that was killed."""
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode = WAL")
        database.executescript(VERSION_1)
        database.execute("INSERT INTO station VALUES (7, 'alpha', 0, ?)", ((rows - 1) * NS_PER_S,))
        packed = (pack("alpha", sample(number)) for number in range(rows))
        database.executemany(
            "INSERT INTO sample VALUES (7, ?, ?, ?, ?)",
            [(row.time_ns, row.seq, row.quality, row.data) for row in packed],
        )
        digest = hashlib.blake2b(b"{}", digest_size=DIGEST_BYTES).digest()
        database.execute("INSERT INTO event VALUES (1, 'verdicts', 7, 5, ?, ?)", (digest, b"{}"))
        database.execute("INSERT INTO hour VALUES (7, 0, x'000000000000F03F')")
        database.commit()


def test_a_database_of_version_1_is_upgraded_and_nothing_is_lost(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    of_version_1(tmp_path / "live.sqlite", 300)
    caplog.set_level("INFO")
    for _ in range(2):
        with contextlib.closing(FolderStore(tmp_path)) as store:
            samples = store.samples("alpha", 0, DAY_NS)
            expected = samples_of([pack("alpha", sample(number)) for number in range(300)])
            assert samples.time_ns.tolist() == expected.time_ns.tolist()
            assert np.array_equal(samples.values, expected.values, equal_nan=True)
            assert store.events("verdicts", "alpha", 0, 10, 10) == [b"{}"]
            assert store.hours("alpha", 0, DAY_NS).values.tolist() == [[1.0]]
            assert store.write(Batch(samples=[pack("alpha", sample(3))])) == 0
    assert caplog.text.count("upgraded from version 1 to 2") == caplog.text.count("from version 2 to 3") == 1
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        historian.handle("blocks", block(298, 299, 300).encode())
        assert historian.commit(0) == 3
        history = History.decode(historian.answer("alpha", HistoryQuery(kind="samples", raw=True).encode()))
        assert history.columns["seq"] == tuple(map(float, range(301)))


@pytest.mark.parametrize(
    ("word", "broken"),
    [(b"first_ns INTEGER, last_ns", b"first_ns INTEGER$ last_ns"), (b"data BLOB NOT NULL,", b"data BLOB NOT NULL$")],
)
def test_a_broken_word_of_the_schema_of_version_1_costs_no_row(tmp_path: Path, word: bytes, broken: bytes) -> None:
    path = tmp_path / "live.sqlite"
    of_version_1(path, 300)
    content = path.read_bytes()
    assert word in content
    path.write_bytes(content.replace(word, broken, 1))
    with contextlib.closing(FolderStore(tmp_path)) as store:
        assert store.samples("alpha", 0, DAY_NS).seq.tolist() == list(range(300))
        assert store.events("verdicts", "alpha", 0, 10, 10) == [b"{}"]
        assert store.hours("alpha", 0, DAY_NS).values.tolist() == [[1.0]]
    assert path.with_name("live.sqlite.refused-1").exists()


def test_a_database_of_version_1_is_not_upgraded_beside_its_historian(tmp_path: Path) -> None:
    of_version_1(tmp_path / "live.sqlite", 10)
    with contextlib.closing(FolderStore(tmp_path / "other")) as other, other.alone():
        (tmp_path / "live.sqlite").rename(tmp_path / "other" / "old.sqlite")
        with pytest.raises(StoreError, match="another historian works here"):
            LiveFile(tmp_path / "other" / "old.sqlite", other.alone)
    with contextlib.closing(sqlite3.connect(tmp_path / "other" / "old.sqlite")) as database:
        assert database.execute("PRAGMA user_version").fetchone() == (1,)


def test_who_may_not_write_the_lock_cannot_upgrade_a_database_of_version_1(tmp_path: Path) -> None:
    of_version_1(tmp_path / "live.sqlite", 10)
    (tmp_path / "historian.lock").mkdir()  # root may write any file, but no folder
    with pytest.raises(StoreError, match=r"lock: cannot be written: Is a directory$"):
        FolderStore(tmp_path)
    (tmp_path / "historian.lock").rmdir()
    with contextlib.closing(FolderStore(tmp_path)) as store:
        assert len(store.samples("alpha", 0, DAY_NS)) == 10


def test_a_database_of_a_later_version_is_refused(tmp_path: Path) -> None:
    FolderStore(tmp_path).close()
    with contextlib.closing(sqlite3.connect(tmp_path / "live.sqlite")) as database:
        database.executescript("CREATE TABLE later (id INTEGER PRIMARY KEY); PRAGMA user_version = 5")
    with pytest.raises(StoreError, match="version 5 is newer than 4"):
        FolderStore(tmp_path)


@pytest.mark.parametrize("version", [12, 0, 3, 4 - 2**31])
def test_a_version_that_a_disk_has_changed_is_damage(tmp_path: Path, version: int) -> None:
    path = tmp_path / "live.sqlite"
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.write(Batch(samples=[pack("alpha", sample(1))]))
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute(f"PRAGMA user_version = {version}")
    assert damage_of(path) == [f"schema: version {version} is not that of its tables"]
    with contextlib.closing(FolderStore(tmp_path)) as store:
        assert len(store.samples("alpha", 0, DAY_NS)) == store.damages == 1
    assert path.with_name("live.sqlite.refused-1").exists()
    assert damage_of(path) == []
