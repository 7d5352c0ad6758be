"""What is missing in a live database shows: rows, and all that came after a backup which is brought back."""

import contextlib
import json
import shutil
import sqlite3

import pytest

from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.rows import pack
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Batch, EventRow, StoreError
from wetwell.services.historian.store.live.row_checksum import event_checksum, sample_checksum
from wetwell.services.historian.store.live.salvage import damage_of

START_NS = 20_000 * DAY_NS
VERSION_3 = """
CREATE TABLE station (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, first_ns INTEGER, last_ns INTEGER);
CREATE TABLE sample (
    station INTEGER NOT NULL, time_ns INTEGER NOT NULL, seq INTEGER NOT NULL, quality INTEGER NOT NULL,
    data BLOB NOT NULL, size INTEGER NOT NULL DEFAULT 1, last_ns INTEGER, crc INTEGER,
    PRIMARY KEY (station, time_ns, seq)
) WITHOUT ROWID;
CREATE TABLE event (
    id INTEGER PRIMARY KEY, kind TEXT NOT NULL, station INTEGER NOT NULL, time_ns INTEGER NOT NULL,
    digest BLOB NOT NULL, payload BLOB NOT NULL, crc INTEGER, UNIQUE (kind, station, time_ns, digest)
);
CREATE TABLE hour (
    station INTEGER NOT NULL, hour_ns INTEGER NOT NULL, data BLOB NOT NULL, crc INTEGER,
    PRIMARY KEY (station, hour_ns)
) WITHOUT ROWID;
CREATE TABLE refused (origin TEXT NOT NULL, key TEXT NOT NULL, content BLOB);
PRAGMA user_version = 3;
"""
"""As version 3 has made them."""


def sample(number):
    pump = PumpReading(frequency_hz=50.0, flow_m3h=90.0, head_m=12.0, power_kw=5.0, running=True)
    return Sample(station="alpha", seq=number, time=START_NS + number * NS_PER_S, level_m=1.0, pumps=(pump,))


def batch(first, last):
    verdicts = [
        EventRow("verdicts", "alpha", START_NS + number * NS_PER_S, f"verdict {number}".encode())
        for number in range(first, last, 10)
    ]
    return Batch(samples=[pack("alpha", sample(number)) for number in range(first, last)], events=verdicts)


def behind_its_back(path, *statements):
    """Change a database as a disk would: no trigger hears of it."""
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as database:
        triggers = database.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            database.execute(f"DROP TRIGGER {name}")
        for statement in statements:
            database.execute(statement)
        for _, text in triggers:
            database.execute(text)


@pytest.fixture
def path(tmp_path):
    with contextlib.closing(FolderStore(tmp_path)) as store, store.at_work():
        store.write(batch(0, 100))
        store.write(batch(50, 120))  # half of it comes again
    assert damage_of(tmp_path / "live.sqlite") == []
    return tmp_path / "live.sqlite"


@pytest.mark.parametrize(
    ("statement", "told"),
    [
        (
            "DELETE FROM sample WHERE seq >= 117",
            "3 rows of samples of station 'alpha' on 2024-10-04 are missing",
        ),
        (
            "DELETE FROM event WHERE payload = CAST('verdict 30' AS BLOB)",
            "1 messages of station 'alpha' on 2024-10-04 are missing",
        ),
        (
            "INSERT INTO event SELECT 99, kind, station, time_ns + 1, digest, payload, crc FROM event WHERE id = 1",
            "1 messages of station 'alpha' on 2024-10-04 were put in",
        ),
        (
            "DELETE FROM tally WHERE origin = 'sample'",
            "120 rows of samples of station 'alpha' on 2024-10-04 were put in",
        ),
        (
            "DELETE FROM sample",
            "120 rows of samples of station 'alpha' on 2024-10-04 are missing",
        ),
    ],
)
def test_rows_that_are_missing_or_put_in_show_are_told_once_and_come_again(path, caplog, statement, told):
    behind_its_back(path, statement)
    assert told in damage_of(path)
    with contextlib.closing(FolderStore(path.parent)) as store:
        next(store.scrub())
        assert told in caplog.text
        assert store.damages == 1
        next(store.scrub())
        assert store.damages == 1
        store.write(batch(0, 120))
        for _ in store.scrub():
            pass
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(120))
        verdicts = store.events("verdicts", "alpha", 0, 2**62, 1000)
        assert set(verdicts) == {f"verdict {number}".encode() for number in range(0, 120, 10)}


def test_a_row_that_was_found_damaged_waits_for_a_writing_that_is_kept(path):
    behind_its_back(path, "UPDATE sample SET quality = quality + 1 WHERE seq = 7")
    with contextlib.closing(FolderStore(path.parent)) as store:
        assert len(store.samples("alpha", 0, 2**62)) == 119
        for _ in range(2):  # a second time says nothing more of the order of the file
            with pytest.raises(StoreError), store.file.transaction() as database:
                raise sqlite3.OperationalError("database or disk is full")
            assert store.file.is_to_be_mended
            assert database.execute("SELECT count(*) FROM refused").fetchone() == (0,)
        store.write(batch(0, 120))
        assert not store.file.is_to_be_mended
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(120))
        assert store.damages == 1


def test_what_is_rolled_into_files_or_deleted_when_it_is_old_is_not_missing(tmp_path):
    with contextlib.closing(FolderStore(tmp_path, keep_days=9)) as store:
        store.write(batch(0, 100))
        for day in (5, 20):
            store.write(batch(day * 86_400, day * 86_400 + 700))
        while store.maintain(2**62) is not None:
            pass
    assert damage_of(tmp_path / "live.sqlite") == []
    with contextlib.closing(sqlite3.connect(tmp_path / "live.sqlite")) as database:
        assert database.execute("SELECT origin, rows FROM tally").fetchall() == [("event", 70), ("sample", 700)]


@pytest.mark.parametrize("bytes_off", [16, 128])
def test_rows_that_stay_are_not_written_over_when_a_day_becomes_a_file(tmp_path, caplog, bytes_off):
    """A disk has changed where the free space of a page ends: all rows can be read, but a deletion harms them."""
    path = tmp_path / "live.sqlite"
    with contextlib.closing(FolderStore(tmp_path)) as store:
        for day in range(3):
            store.write(batch(day * 86_400, day * 86_400 + 100))
    with contextlib.closing(sqlite3.connect(path)) as database:
        (root,) = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'sample'").fetchone()
        (page_bytes,) = database.execute("PRAGMA page_size").fetchone()
    content = bytearray(path.read_bytes())
    place = slice((root - 1) * page_bytes + 5, (root - 1) * page_bytes + 7)
    content[place] = (int.from_bytes(content[place], "big") + bytes_off).to_bytes(2, "big")
    path.write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        assert len(store.samples("alpha", 0, 2**62)) == 300
        with pytest.raises(StoreError, match="On tree page"):
            store.maintain(2**62)
        store.write(Batch())
        assert "a new one is begun with 331 rows of it; at least 0 are lost" in caplog.text
        while store.maintain(2**62) is not None:
            pass
        assert store.archive.days_ns("samples", "alpha") == [START_NS]
        assert len(store.samples("alpha", 0, 2**62)) == 300
    assert damage_of(path) == []


def test_the_database_is_looked_through_once_before_days_of_several_stations_become_files(tmp_path, monkeypatch):
    looks = []
    with contextlib.closing(FolderStore(tmp_path)) as store:
        monkeypatch.setattr(store.file, "check", lambda: looks.append(1))
        for day in range(4):
            for station in ("alpha", "beta"):
                store.write(Batch([pack(station, sample(day * 86_400 + number)) for number in range(20)]))
            while store.maintain(2**62) is not None:
                pass
            assert len(looks) == max(0, day - 1)
        assert store.archive.days_ns("samples", "beta") == [START_NS, START_NS + DAY_NS]


def test_a_database_of_version_3_is_counted_when_it_is_opened(tmp_path):
    path = tmp_path / "live.sqlite"
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.executescript(VERSION_3)
        database.execute("INSERT INTO station VALUES (1, 'alpha', 0, 0)")
        kept = batch(0, 50)
        for row in kept.samples:
            crc = sample_checksum(1, row.time_ns, row.seq, row.quality, 1, row.data) if row.seq % 2 else None
            values = (1, row.time_ns, row.seq, row.quality, row.data, 1, None, crc)
            database.execute("INSERT INTO sample VALUES (?, ?, ?, ?, ?, ?, ?, ?)", values)
        for number, row in enumerate(kept.events):
            crc = event_checksum(row.kind, 1, row.time_ns, row.payload)
            values = (number, row.kind, 1, row.time_ns, row.digest, row.payload, crc)
            database.execute("INSERT INTO event VALUES (?, ?, ?, ?, ?, ?, ?)", values)
        database.commit()
    assert damage_of(path) == []
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.write(batch(40, 60))
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(60))
        assert len(store.events("verdicts", "alpha", 0, 2**62, 1000)) == 6
    assert damage_of(path) == []
    behind_its_back(path, "DELETE FROM sample WHERE seq = 0")
    assert damage_of(path) == ["1 rows of samples of station 'alpha' on 2024-10-04 are missing"]


def test_a_backup_that_is_brought_back_and_another_database_are_told_once(path, caplog):
    shutil.copy(path, path.with_name("backup"))
    with contextlib.closing(FolderStore(path.parent)) as store, store.at_work():
        store.write(batch(120, 130))
    for suffix in ("-wal", "-shm"):
        path.with_name(f"live.sqlite{suffix}").unlink(missing_ok=True)
    shutil.copy(path.with_name("backup"), path)
    (told,) = damage_of(path)
    assert told == "commits 4 to 5 are missing: it is of an earlier time"
    with contextlib.closing(FolderStore(path.parent)) as store:
        assert told in caplog.text
        assert store.damages == 1
    assert damage_of(path) == []
    path.unlink()
    with contextlib.closing(FolderStore(path.parent)) as store:
        assert "it is not the one that was here before" in caplog.text
    lines = [json.loads(line) for line in (path.parent / "history-audit.jsonl").read_text().splitlines()]
    assert [line["act"] for line in lines] == ["found a database that is not known as the last one"] * 2
    assert [line["reason"] for line in lines] == [told, "it is not the one that was here before"]


@pytest.mark.parametrize("content", [b"", b'{"name": "a"}', None])
def test_a_database_of_an_earlier_time_beside_a_damaged_end_is_told_once(path, caplog, content):
    backup = path.read_bytes()
    with contextlib.closing(FolderStore(path.parent)) as store, store.at_work():
        store.write(batch(120, 130))
    path.write_bytes(backup)
    end = path.with_suffix(".end")
    end.write_bytes(end.read_bytes()[:-1] if content is None else content)  # torn by a disk that lies
    (told,) = damage_of(path)
    assert told == "live.end cannot be read: nobody knows whether the database is of an earlier time"
    with contextlib.closing(FolderStore(path.parent)) as store:
        assert told in caplog.text
        assert store.damages == 1
    assert damage_of(path) == []
    (line,) = (path.parent / "history-audit.jsonl").read_text().splitlines()
    assert json.loads(line)["reason"] == told


def test_only_the_one_historian_says_how_far_a_database_has_come(path):
    end = path.with_suffix(".end")
    before = end.read_bytes()
    with contextlib.closing(FolderStore(path.parent)) as importer:
        importer.write(batch(120, 130))
    assert end.read_bytes() == before
    with contextlib.closing(FolderStore(path.parent)) as historian, historian.at_work():
        pass
    assert end.read_bytes() != before


def test_a_database_that_was_killed_is_not_behind_what_is_said_of_it(path):
    store = FolderStore(path.parent)
    store.write(batch(120, 140))
    store.file.mark_end()
    store.write(batch(140, 160))
    assert damage_of(path) == []
    store.file._writer.close()  # as a kill: nothing is said
    with contextlib.closing(FolderStore(path.parent)) as again:
        assert again.damages == 0


@pytest.mark.parametrize("statement", ["DELETE FROM head", "UPDATE head SET commits = 'x'"])
def test_a_database_without_its_head_is_put_aside_and_saved(path, statement):
    behind_its_back(path, statement)
    assert damage_of(path) == ["its head is damaged"]
    with contextlib.closing(FolderStore(path.parent)) as store:
        assert store.damages == 1
        assert len(store.samples("alpha", 0, 2**62)) == 120
    assert damage_of(path) == []


def test_a_damaged_database_is_put_aside_by_the_historian_that_works_on_it_and_by_nobody_else(path):
    with contextlib.closing(FolderStore(path.parent)) as store, store.at_work():
        with contextlib.closing(FolderStore(path.parent)) as importer:
            behind_its_back(path, "UPDATE head SET commits = 'x'")
            importer.file.is_damaged = True
            refused = r"live\.sqlite: damaged; historian\.folder: .*: another historian works here$"
            with pytest.raises(StoreError, match=refused):
                importer.write(batch(120, 130))
        with pytest.raises(StoreError, match=r"its head is damaged; .* another historian works here$"):
            FolderStore(path.parent)
        assert not path.with_name("live.sqlite.refused-1").exists()
        store.file.is_damaged = True
        store.write(batch(120, 130))
    assert path.with_name("live.sqlite.refused-1").exists()
    assert damage_of(path) == []
    with contextlib.closing(FolderStore(path.parent)) as store:
        assert len(store.samples("alpha", 0, 2**62)) == 130


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE event SET time_ns = 'text' WHERE id = 1",
        "UPDATE event SET time_ns = 1e300 WHERE id = 1",
        "UPDATE event SET time_ns = x'00' WHERE id = 1",
        "UPDATE event SET time_ns = -9223372036854775807 WHERE id = 1",
    ],
)
def test_a_stamp_that_became_something_else_is_told(path, statement):
    behind_its_back(path, statement)
    told = damage_of(path)
    assert "1 messages of station 'alpha' on 2024-10-04 are missing" in told
    assert "1 messages are not what was written" in told
    with contextlib.closing(FolderStore(path.parent)) as store:
        next(store.scrub())
        assert store.damages == 2  # one is missing on its day, one was put in on another
