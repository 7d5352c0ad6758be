"""A live database in which a disk has changed something: what it still gives is what was written, and it goes on."""

import contextlib
import logging
import random
import sqlite3

import pytest

from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.rows import pack, pack_arrays
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import Batch, EventRow, StationSpan, StoreError
from wetwell.services.historian.store.live.salvage import damage_of

PAGE = 4096
ROWS_OF_A_PAGE = 60
"""Of samples that came alone, at the most."""
INTERIOR = 2
"""First byte of a page of SQLite whose rows stand between those of other pages."""
INDEX_LEAF = 10
"""That of a page of an index."""
SECTOR = 512
STATIONS = ("alpha", "beta")
TIMES = 3_000


def sample(station: str, number: int) -> Sample:
    pump = PumpReading(frequency_hz=50.0, flow_m3h=90.0 + number, head_m=12.0, power_kw=5.0, running=True)
    return Sample(
        station=station, seq=number, time=number * 10 * NS_PER_S, level_m=1.0 + number / TIMES, pumps=(pump,)
    )


def payload(station: str, number: int) -> bytes:
    return f'{{"number":{number},"station":"{station}"}}'.encode()


def batch(station: str, first: int, last: int) -> Batch:
    rows = [pack(station, sample(station, number)) for number in range(first, last)]
    if station == "beta":  # many in a row
        samples = Samples.of_rows([(row.time_ns, row.seq, row.size, row.quality, row.data) for row in rows])
        rows = pack_arrays(station, samples.time_ns, samples.seq, samples.quality, samples.values)
    events = [EventRow("verdicts", station, number, payload(station, number)) for number in range(first, last, 10)]
    return Batch(samples=rows, events=events)


@pytest.fixture(scope="module")
def content(tmp_path_factory) -> bytes:
    folder = tmp_path_factory.mktemp("written")
    with contextlib.closing(FolderStore(folder)) as store:
        for station in STATIONS:
            store.write(batch(station, 0, TIMES))
    with contextlib.closing(FolderStore(folder)) as store:
        store.file._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return (folder / "live.sqlite").read_bytes()


def flipped(content: bytes, dice: random.Random) -> bytes:
    changed = bytearray(content)
    changed[dice.randrange(len(changed))] ^= 1 << dice.randrange(8)
    return bytes(changed)


def misdirected(content: bytes, dice: random.Random) -> bytes:
    changed = bytearray(content)
    source, target = dice.sample(range(len(content) // PAGE), 2)
    changed[target * PAGE : (target + 1) * PAGE] = content[source * PAGE : (source + 1) * PAGE]
    return bytes(changed)


def torn(content: bytes, dice: random.Random) -> bytes:
    return content[: dice.randrange(1, len(content))]


def cleared(content: bytes, dice: random.Random) -> bytes:
    changed = bytearray(content)
    place = dice.randrange(len(content) // SECTOR) * SECTOR
    changed[place : place + SECTOR] = bytes(SECTOR)
    return bytes(changed)


def persistent(act):
    """What the store says, tried again as the historian does."""
    for _ in range(3):
        with contextlib.suppress(StoreError):
            return act()
    raise AssertionError("the store does not get over it")


@pytest.mark.parametrize("damage", [flipped, misdirected, torn, cleared])
@pytest.mark.parametrize("seed", range(12))
def test_what_is_left_is_what_was_written_and_new_samples_are_kept(content, tmp_path, caplog, damage, seed):
    caplog.set_level(logging.WARNING)
    dice = random.Random(f"{damage.__name__} {seed}")
    path = tmp_path / "live.sqlite"
    path.write_bytes(damage(content, dice))
    is_found = damage_of(path) != []
    with contextlib.closing(FolderStore(tmp_path)) as store:
        for station in STATIONS:
            persistent(lambda station=station: store.write(batch(station, TIMES, TIMES + 20)))
        with contextlib.suppress(StoreError):
            list(store.scrub())
        for station in STATIONS:  # mends what was found
            persistent(lambda station=station: store.write(batch(station, TIMES, TIMES + 30)))
        lost = 0
        for station in STATIONS:
            kept = persistent(lambda station=station: store.samples(station, 0, 2**62))
            wanted = {number: sample(station, number) for number in range(TIMES + 30)}
            numbers = kept.seq.tolist()
            assert numbers == sorted(set(numbers))
            assert set(range(TIMES, TIMES + 30)) <= set(numbers)
            for number, time_ns, values in zip(numbers, kept.time_ns.tolist(), kept.values, strict=True):
                one = wanted[number]
                assert (time_ns, values[0], values[3]) == (one.time, one.level_m, one.pumps[0].flow_m3h)
            verdicts = persistent(lambda station=station: store.events("verdicts", station, 0, 2**62, 10_000))
            told = [payload(station, number) for number in range(0, TIMES + 30, 10)]
            assert set(verdicts) <= set(told)
            assert len(verdicts) == len(set(verdicts))
            lost += TIMES + 30 - len(numbers) + len(told) - len(verdicts)
        if lost:
            assert is_found
            assert "live.sqlite" in caplog.text


@pytest.mark.parametrize("apart", [[0], [0, 100, 200], [0, 150, 300, 1_000]])
def test_pages_that_cannot_be_read_cost_their_own_rows_only(content, tmp_path, apart):
    changed = bytearray(content)
    for number in apart:
        page = content.index(sample("alpha", 1_500 + number).time.to_bytes(6, "big")) // PAGE * PAGE
        changed[page : page + PAGE] = bytes(PAGE)
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        with pytest.raises(StoreError, match="malformed"):
            store.samples("alpha", 0, 2**62)
        store.write(Batch())
        kept = store.samples("alpha", 0, 2**62)
        assert TIMES - ROWS_OF_A_PAGE * len(apart) <= len(kept) < TIMES
        assert store.damages == 1
        assert (tmp_path / "live.sqlite.refused-1").exists()


def test_a_row_without_a_time_beside_a_page_that_cannot_be_read_costs_no_other_rows(content, tmp_path):
    places = [content.index(sample("alpha", number).time.to_bytes(6, "big")) for number in range(1_000, 2_000)]
    middle = places[500] // PAGE * PAGE
    time = next(place for place in places[500::-1] if place // PAGE * PAGE != middle)
    header = content.rindex(bytes([9, 9, 5]), 0, time)  # of its length, a station that is 1, and a time of six bytes
    assert header == time - 9
    changed = bytearray(content)
    changed[middle : middle + PAGE] = bytes(PAGE)
    changed[header + 2 : header + 4] = bytes([0, 6])  # no time, and a number of eight bytes
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        with pytest.raises(StoreError, match="malformed"):
            store.samples("alpha", 0, 2**62)
        store.write(Batch())
        assert TIMES - ROWS_OF_A_PAGE - 1 <= len(store.samples("alpha", 0, 2**62)) < TIMES


@pytest.mark.parametrize("place", [payload("alpha", 1_230), pack("alpha", sample("alpha", 1_234)).data])
def test_what_comes_again_takes_the_place_of_what_was_damaged(content, tmp_path, place):
    changed = bytearray(content)
    changed[changed.index(place) + 3] ^= 1
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.write(batch("alpha", 0, TIMES))
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(TIMES))
        told = [payload("alpha", number) for number in range(0, TIMES, 10)]
        assert store.events("verdicts", "alpha", 0, 2**62, 10_000) == told


@pytest.mark.parametrize("column", ["quality", "data", "size", "last_ns", "crc"])
def test_what_comes_again_takes_the_place_of_a_row_that_became_a_text_that_is_no_utf8(content, tmp_path, column):
    (tmp_path / "live.sqlite").write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        change = f"UPDATE sample SET {column} = CAST(x'FF00' AS TEXT) WHERE time_ns = ?"  # noqa: S608 - of above
        store.file._writer.execute(change, (sample("alpha", 1_234).time,))
        for station in STATIONS:
            store.write(batch(station, 0, TIMES))
            assert store.samples(station, 0, 2**62).seq.tolist() == list(range(TIMES))


def test_what_is_damaged_is_put_aside_by_the_next_writing(content, tmp_path):
    changed = bytearray(content)
    for place in (payload("alpha", 1_230), pack("alpha", sample("alpha", 1_234)).data):
        changed[changed.index(place) + 3] ^= 1
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        assert store.live.put_aside_damaged("alpha", 0, 2**62) == 2
        refused = store.file._writer.execute("SELECT origin, content FROM refused ORDER BY origin").fetchall()
        assert [origin for origin, _ in refused] == ["event", "sample"]
        assert all(content in changed for _, content in refused)
        assert len(store.samples("alpha", 0, 2**62)) == TIMES - 1
        assert len(store.events("verdicts", "alpha", 0, 2**62, 10_000)) == TIMES // 10 - 1
        assert store.live.put_aside_damaged("alpha", 0, 2**62) == 0


def test_a_row_that_is_not_where_its_time_says_is_put_aside_in_the_end(content, tmp_path):
    written, changed = sample("alpha", 1_500).time.to_bytes(6, "big"), (205 * NS_PER_S).to_bytes(6, "big")
    place = content.index(written)
    (tmp_path / "live.sqlite").write_bytes(content[:place] + changed + content[place + 6 :])
    with contextlib.closing(FolderStore(tmp_path)) as store:
        told = [store.live.put_aside_damaged("alpha", 0, 2**62) for _ in range(5)]
        assert told[-1] == 0
        store.write(Batch())
        assert store.live.put_aside_damaged("alpha", 0, 2**62) == 0
        assert store.samples("alpha", 0, 2**62).seq.tolist() == [one for one in range(TIMES) if one != 1_500]
        assert store.damages > 0
        assert damage_of(tmp_path / "live.sqlite") == []


def test_a_row_between_pages_that_says_an_earlier_time_than_all_costs_no_other_row(content, tmp_path):
    """SQLite finds the first row of the table in its place, and would delete that."""
    places = {one: content.index(sample("alpha", one).time.to_bytes(6, "big")) for one in range(50, TIMES)}
    wrong, place = next(item for item in places.items() if content[item[1] // PAGE * PAGE] == INTERIOR)
    changed = content[:place] + (-60 * NS_PER_S).to_bytes(6, "big", signed=True) + content[place + 6 :]
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        for _ in range(3):
            store.live.put_aside_damaged("alpha", -(2**63), 2**62)
        assert store.samples("alpha", -(2**63), 2**62).seq.tolist() == [one for one in range(TIMES) if one != wrong]
    assert damage_of(tmp_path / "live.sqlite") == []


@pytest.mark.parametrize("station", STATIONS)
def test_a_row_that_says_the_time_of_its_last_sample_wrongly_is_found_and_kept(content, tmp_path, station):
    """Who asks for a span finds it no more; by its data it has that time, or is alone."""
    (tmp_path / "live.sqlite").write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        wrong = (
            "UPDATE sample SET last_ns = 5 WHERE seq % 3 = 0 AND station = (SELECT id FROM station WHERE name = ?)"
        )
        store.file._writer.execute(wrong, (station,))
        assert len(store.samples(station, 100, 2**62)) < TIMES - 1
        assert len(damage_of(tmp_path / "live.sqlite")) == 1
        assert store.live.put_aside_damaged(station, 0, 2**62) == 1
        assert store.samples(station, 0, 2**62).seq.tolist() == list(range(TIMES))
        assert store.live.put_aside_damaged(station, 0, 2**62) == 0
    assert damage_of(tmp_path / "live.sqlite") == []


@pytest.mark.parametrize(
    ("wrong", "left"),
    [
        ("UPDATE sample SET last_ns = crc WHERE seq = 10000", 3),
        ("UPDATE sample SET last_ns = crc, crc = NULL WHERE seq = 10000", 2),
    ],
)
def test_a_complete_day_of_one_row_is_filed_though_that_says_another_time(tmp_path, wrong, left):
    """Where a disk has changed the head of the row, the checksum may stand in the wrong column: nothing checks it."""
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.write(Batch(samples=[pack("alpha", sample("alpha", number)) for number in (10_000, 40_000, 40_001)]))
        store.file._writer.execute(wrong)
        done = [store.maintain(10 * 86_400 * NS_PER_S) for _ in range(6)]
        assert done[-1] is None
        assert store.samples("alpha", 0, 2**62).seq.tolist() == [10_000, 40_000, 40_001][-left:]


def test_a_row_that_was_put_aside_meanwhile_is_no_damage_of_the_file(content, tmp_path):
    (tmp_path / "live.sqlite").write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.file.refused.note("sample", 1, 5, 5)
        store.write(Batch())
        assert store.damages == 0
        assert not store.file.is_damaged


@pytest.mark.parametrize("copied", [-1, 1])
def test_a_damaged_copy_of_a_row_costs_no_intact_one(content, tmp_path, copied):
    """A page in the place of the next or last one has its rows a second time, and a bit of one of those flips."""
    places = [content.index(pack("alpha", sample("alpha", number)).data) for number in range(1_000, 1_300)]
    leaves = list(dict.fromkeys(at // PAGE * PAGE for at in places if content[at // PAGE * PAGE] != INTERIOR))
    source, target = leaves[2], leaves[2 + copied]
    number = next(number for number, at in enumerate(places) if at // PAGE * PAGE == source)
    changed = bytearray(content)
    changed[target : target + PAGE] = content[source : source + PAGE]
    changed[target + places[number] - source + 3] ^= 1
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        for _ in range(3):
            store.live.put_aside_damaged("alpha", 0, 2**62)
        with contextlib.suppress(StoreError):
            list(store.scrub())
        store.write(Batch())
        kept = store.samples("alpha", 0, 2**62).seq.tolist()
        assert 1_000 + number in kept
        assert kept == sorted(set(kept))
    assert damage_of(tmp_path / "live.sqlite") == []


def test_what_was_found_damaged_of_a_file_costs_nothing_of_the_one_begun_anew(content, tmp_path):
    (tmp_path / "live.sqlite").write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.file.refused.note("sample", 1, sample("alpha", 7).time, 7)
        store.file.refused.note("event", 3)
        store.file.is_damaged = True
        store.write(Batch())
        assert len(store.samples("alpha", 0, 2**62)) == TIMES
        assert len(store.events("verdicts", "alpha", 0, 2**62, 10_000)) == TIMES // 10


@pytest.mark.parametrize("is_message", [True, False])
def test_what_the_writer_remembers_of_a_row_that_the_disk_has_changed_mends_it(tmp_path, is_message):
    row = payload("alpha", 10) if is_message else pack("alpha", sample("alpha", 10)).data
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.write(batch("alpha", 0, 30))
        store.file._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        store.write(batch("alpha", 0, 30))  # it has all pages in its memory
        content = (tmp_path / "live.sqlite").read_bytes()
        place = content.index(row) + 3
        with (tmp_path / "live.sqlite").open("r+b") as file:
            file.seek(place)
            file.write(bytes([content[place] ^ 1]))
        assert store.live.put_aside_damaged("alpha", 0, 2**62) == 1
        assert store.live.put_aside_damaged("alpha", 0, 2**62) == 0
        assert len(store.samples("alpha", 0, 2**62)) == 30
        assert len(store.events("verdicts", "alpha", 0, 2**62, 10_000)) == 3
        store.file.check()
        assert store.damages == 1  # others may have been changed, too


def test_a_row_whose_station_was_changed_costs_no_row_behind_it(content, tmp_path):
    (tmp_path / "live.sqlite").write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        rows = store.file._writer.execute("SELECT station, time_ns, size FROM sample WHERE size > 1").fetchall()
    number, time_ns, size = rows[len(rows) // 2]
    key = number.to_bytes(1, "big") + time_ns.to_bytes(6, "big")
    assert content.count(key) == 1
    (tmp_path / "live.sqlite").write_bytes(content.replace(key, b"\x70" + key[1:]))
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.file.is_damaged = True
        store.write(batch("alpha", TIMES, TIMES + 1))
        assert len(store.samples("beta", 0, 2**62)) == TIMES - size


def test_rows_of_no_station_of_which_nothing_else_can_be_read_cost_none_between_them(content, tmp_path):
    """Their data are said to be longer than the row: SQLite ends a scan as soon as it looks at them."""
    (tmp_path / "live.sqlite").write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        rows = store.file._writer.execute("SELECT station, time_ns, size FROM sample WHERE size > 1").fetchall()
    changed, lost = bytearray(content), 0
    for number, time_ns, size in (rows[len(rows) // 3], rows[2 * len(rows) // 3]):
        place = content.index(number.to_bytes(1, "big") + time_ns.to_bytes(6, "big"))
        head = next(place - length for length in range(5, 20) if content[place - length] == length)
        assert content[head + 5] > 0x80, "after those of station, time, number and quality the type of the data"
        changed[head + 5], changed[place] = 0xFF, 0x70
        lost += size
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.file.is_damaged = True
        store.write(batch("alpha", TIMES, TIMES + 1))
        assert len(store.samples("beta", 0, 2**62)) == TIMES - lost


@pytest.mark.parametrize("data", [b"", b"odd"])
def test_where_a_history_ends_is_told_though_its_last_row_is_damaged(content, tmp_path, data):
    (tmp_path / "live.sqlite").write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        last_ns = store.newest_ns("alpha")
        store.file._writer.execute("UPDATE sample SET data = ? WHERE time_ns = ?", (data, last_ns))
        assert store.newest_ns("alpha") == last_ns - 10 * NS_PER_S


def test_a_message_whose_place_was_changed_is_not_told_twice_when_it_comes_again(content, tmp_path):
    (tmp_path / "live.sqlite").write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.file._writer.execute("UPDATE event SET time_ns = 1231 WHERE payload = ?", (payload("alpha", 1_230),))
        store.write(batch("alpha", 0, TIMES))
        told = [payload("alpha", number) for number in range(0, TIMES, 10)]
        assert store.events("verdicts", "alpha", 0, 2**62, 10_000) == told
    assert damage_of(tmp_path / "live.sqlite") == ["1 messages are not what was written"]


@pytest.mark.parametrize("is_open", [False, True])
def test_a_broken_word_in_the_schema_is_damage_though_it_is_no_text(content, tmp_path, caplog, is_open):
    changed = content.replace(b"AFTER DELETE", b"AFTER DEL\xc5TE", 1)
    assert changed != content
    path = tmp_path / "live.sqlite"
    path.write_bytes(content if is_open else changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        if is_open:
            path.write_bytes(changed)
            with pytest.raises(StoreError, match="codec can't decode byte"):
                store.file.check()
            assert "codec can't decode byte" in damage_of(path)[0]
        store.write(batch("alpha", 0, TIMES))
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(TIMES))
    assert (tmp_path / "live.sqlite.refused-1").exists()
    assert "a new one is begun" in caplog.text


@pytest.mark.parametrize("is_open", [False, True])
def test_a_head_that_forbids_writing_is_damage_and_costs_no_row(content, tmp_path, caplog, is_open):
    changed = bytearray(content)
    changed[18] ^= 0x10  # the format for writing
    path = tmp_path / "live.sqlite"
    path.write_bytes(content if is_open else changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        if is_open:
            store.file._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            path.write_bytes(changed)
            store.file._writer.execute("PRAGMA shrink_memory")  # it is read anew
            with pytest.raises(StoreError, match="readonly"):
                store.write(Batch())
        store.write(batch("alpha", TIMES, TIMES + 1))
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(TIMES + 1))
    assert (tmp_path / "live.sqlite.refused-1").exists()
    assert "a new one is begun" in caplog.text


@pytest.mark.parametrize("is_open", [False, True])
@pytest.mark.parametrize("place", [19, 21, 47, 59])
def test_a_head_that_forbids_reading_is_damage_and_costs_no_row(content, tmp_path, caplog, is_open, place):
    changed = bytearray(content)
    changed[place] ^= 0x12  # format for reading, share of a page that a row may take, format of tables, code of texts
    path = tmp_path / "live.sqlite"
    path.write_bytes(content if is_open else changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        if is_open:
            path.write_bytes(changed)
            with pytest.raises(StoreError):
                store.file.check()
        store.write(batch("alpha", TIMES, TIMES + 1))
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(TIMES + 1))
        assert store.samples("beta", 0, 2**62).seq.tolist() == list(range(TIMES))
    assert (tmp_path / "live.sqlite.refused-1").exists()
    assert "a new one is begun" in caplog.text


@pytest.mark.parametrize(
    ("word", "broken", "part"),
    [
        (b"coalesce(OLD.crc", b"coalesce(OMD.crc", "event_goes"),
        (b"data BLOB NOT NULL, crc", b"dada BLOB NOT NULL, crc", "hour"),
    ],
)
def test_a_word_of_the_schema_that_names_another_thing_is_damage(content, tmp_path, caplog, word, broken, part):
    changed = content.replace(word, broken, 1)
    assert changed != content
    path = tmp_path / "live.sqlite"
    path.write_bytes(changed)
    assert f"schema: {part}" in " ".join(damage_of(path))
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.write(batch("alpha", 0, TIMES))
        assert store.samples("alpha", 0, 2**62).seq.tolist() == list(range(TIMES))
    assert (tmp_path / "live.sqlite.refused-1").exists()
    assert f"schema: {part}" in caplog.text


@pytest.mark.parametrize(
    ("word", "broken"),
    [
        (b"last_ns INTEGER, crc", b"mast_ns INTEGER, crc"),
        (b"first_ns INTEGER, last_ns INTEGER)", b"firsv_ns INTEGER, last_ns INTEGER)"),
        (b"name TEXT NOT NULL UNIQUE", b"nam\xe5 TEXT NOT NULL UNIQUE"),
        (b"first_ns INTEGER, last_ns INTEGER)", b"first_ns INTEGER$ last_ns INTEGER)"),  # a column less
        (b"size INTEGER NOT NULL DEFAULT 1", b"size INTEGER NOT NULL DEFAULU 1"),  # no SQL any more
        (b"PRIMARY KEY (station, time_ns, seq)", b"PRIMARY KEY (station, time_ns& seq)"),
        (b"seq)\n) WITHOUT ROWID", b"seq)\n) WITHOUT SOWID"),
        (b"CREATE TABLE event", b"CREATE TABLE evenu"),
        (b"data BLOB NOT NULL, size", b"data BLOB NOT NULL, si\xf3e"),
        (b"AFTER DELETE", b"AFTER DEL\xc5TE"),
        (b"INSERT INTO tally", b"INSERT IN\x11O tally"),
    ],
)
def test_a_broken_word_of_the_schema_costs_no_row(content, tmp_path, word, broken):
    changed = content.replace(word, broken, 1)
    assert changed != content
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.write(Batch())
        for station in STATIONS:
            assert store.samples(station, 0, 2**62).seq.tolist() == list(range(TIMES))
            assert len(store.events("verdicts", station, 0, 2**62, 10_000)) == TIMES // 10
    assert (tmp_path / "live.sqlite.refused-1").exists()


@pytest.mark.parametrize("place", ["table", "index"])
def test_a_station_whose_name_was_changed_keeps_its_own(content, tmp_path, place):
    changed = bytearray(content)
    found = [at for at in range(len(changed)) if changed.startswith(b"beta", at) and changed[at - 1] != ord('"')]
    assert len(found) == 2
    changed[found[place == "table"]] ^= 0x80  # no UTF-8 any longer
    path = tmp_path / "live.sqlite"
    path.write_bytes(changed)
    assert damage_of(path)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        with contextlib.suppress(StoreError):
            store.file.check()
        store.write(Batch())
        assert [span.station for span in store.stations()] == ["alpha", "beta"]
        assert len(store.samples("beta", 0, 2**62)) == TIMES


def test_a_head_whose_count_is_gone_is_mended_though_maintenance_cannot_write(tmp_path):
    """No commit is counted any more, that of a day that is to become a file neither."""
    path = tmp_path / "live.sqlite"
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        store.write(batch("alpha", 0, TIMES))
        store.write(batch("alpha", 40_000, 41_000))  # the first day is complete
        store.file._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        (name,) = store.file._writer.execute("SELECT name FROM head").fetchone()
        counted, not_counted = (bytes((3, *types)) + name.encode() for types in ((45, 1), (47, 0)))
        content = path.read_bytes()
        assert content.count(counted) == 1
        path.write_bytes(content.replace(counted, not_counted))  # now the number is a letter of the name
        store.file._writer.execute("PRAGMA shrink_memory")
        with pytest.raises(StoreError, match=r"head\.commits"):
            store.write(Batch())
        assert not historian.maintain(10 * 86_400 * NS_PER_S)
        assert historian.figures(0)["failed_maintenance"] == 1.0
        store.write(Batch())
        assert len(store.samples("alpha", 0, 2**62)) == TIMES + 1_000
    assert path.with_name("live.sqlite.refused-1").exists()


def test_another_index_in_the_place_of_the_names_costs_no_station_though_no_message_can_be_read(content, tmp_path):
    path = tmp_path / "live.sqlite"
    path.write_bytes(content)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        pages = dict(store.file._writer.execute("SELECT name, rootpage FROM sqlite_master WHERE rootpage"))
    names, messages = ((pages[name] - 1) * PAGE for name in ("sqlite_autoindex_station_1", "event"))
    leaves = [content[at : at + PAGE] for at in range(0, len(content), PAGE) if content[at] == INDEX_LEAF]
    changed = bytearray(content)
    changed[names : names + PAGE] = next(page for page in leaves if b"verdicts" in page)
    changed[messages : messages + PAGE] = bytes(PAGE)
    path.write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        store.file.is_damaged = True
        store.write(Batch())
        assert [span.station for span in store.stations()] == ["alpha", "beta"]
        assert [len(store.samples(station, 0, 2**62)) for station in STATIONS] == [TIMES, TIMES]


@pytest.mark.parametrize("byte", [b"\0", b"\xff"])
def test_a_table_of_stations_that_cannot_be_read_costs_no_sample(content, tmp_path, byte):
    """Messages confirm the names that the index has."""
    (tmp_path / "live.sqlite").write_bytes(content)
    page = (roots_of(tmp_path)["station"] - 1) * PAGE
    (tmp_path / "live.sqlite").write_bytes(content[:page] + byte * PAGE + content[page + PAGE :])
    with contextlib.closing(FolderStore(tmp_path)) as store:
        with contextlib.suppress(StoreError):
            store.file.check()
        persistent(lambda: store.write(Batch()))
        assert [len(store.samples(station, 0, 2**62)) for station in STATIONS] == [TIMES, TIMES]
        last_ns = sample("alpha", TIMES - 1).time
        assert store.stations() == [StationSpan("alpha", 0, last_ns), StationSpan("beta", 0, last_ns)]


def test_hours_on_a_page_of_samples_are_not_deleted_there(content, tmp_path):
    """Of two tables with one page the other one has rows there."""
    (tmp_path / "live.sqlite").write_bytes(content)
    samples, hours = (roots_of(tmp_path)[name] - 1 for name in ("sample", "hour"))
    changed = bytearray(content)
    changed[hours * PAGE : (hours + 1) * PAGE] = content[samples * PAGE : (samples + 1) * PAGE]
    (tmp_path / "live.sqlite").write_bytes(changed)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        assert not len(store.hours("alpha", 0, 30_000 * NS_PER_S))
        persistent(lambda: store.write(Batch()))
        assert [len(store.samples(station, 0, 2**62)) for station in STATIONS] == [TIMES, TIMES]
    assert (tmp_path / "live.sqlite.refused-1").exists()


def roots_of(folder) -> dict[str, int]:
    """First page of each table and index."""
    with contextlib.closing(sqlite3.connect(folder / "live.sqlite")) as database:
        return dict(database.execute("SELECT name, rootpage FROM sqlite_master"))
