"""A daily file that is missing, or another one than was written, shows; one that was deleted on purpose does not."""

import contextlib
import shutil

import pyarrow.parquet
import pytest

from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.rows import pack
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store import archive
from wetwell.services.historian.store.archive import Archive
from wetwell.services.historian.store.day_ledger import DayLedger
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Batch, StoreError

START_NS = 20_000 * DAY_NS


def write(store, days):
    """Samples of some days, a hundred a day; complete ones become files."""
    pump = PumpReading(frequency_hz=50.0, flow_m3h=90.0, head_m=12.0, power_kw=5.0, running=True)
    for day in days:
        samples = [
            Sample(station="alpha", seq=day * 100 + n, time=START_NS + day * DAY_NS + n * NS_PER_S, pumps=(pump,))
            for n in range(100)
        ]
        store.write(Batch(samples=[pack("alpha", sample) for sample in samples]))
    while store.maintain(2**62) is not None:
        pass


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    with contextlib.closing(FolderStore(folder)) as store:
        write(store, range(6))
    return folder


@pytest.fixture
def folder(written, tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "SETTLE_S", 0.0)
    shutil.copytree(written, tmp_path / "history")
    return tmp_path / "history"


def scrubbed(folder):
    """Damages that a look through finds."""
    with contextlib.closing(FolderStore(folder)) as store:
        for _ in store.scrub():
            pass
        return store.damages


def test_what_was_written_is_whole(folder):
    assert len(DayLedger(folder).expected("alpha")) == 8  # of four days samples and ten minutes
    assert Archive(folder).damage() == []
    assert scrubbed(folder) == 0


@pytest.mark.parametrize("form", ["samples", "tens"])
def test_a_day_that_is_missing_shows_and_is_told_once(folder, caplog, form):
    path = sorted((folder / form / "station=alpha").iterdir())[1]
    path.unlink()
    assert Archive(folder).damage() == [f"{path}: is missing"]
    assert scrubbed(folder) == 1
    assert f"{path}: is missing" in caplog.text
    assert scrubbed(folder) == 0


def test_a_station_whose_files_are_all_gone_shows(folder):
    shutil.rmtree(folder / "samples")
    shutil.rmtree(folder / "tens")
    assert len(Archive(folder).damage()) == 8


def test_a_file_of_an_earlier_time_in_the_place_of_a_later_one_shows_and_stays(folder, written, caplog):
    with contextlib.closing(FolderStore(folder)) as store:
        pump = PumpReading(flow_m3h=1.0)
        late = Sample(station="alpha", seq=9_000, time=START_NS + 5_000 * NS_PER_S, pumps=(pump,))
        store.write(Batch(samples=[pack("alpha", late)]))
        while store.maintain(2**62) is not None:
            pass
        assert len(store.archive.samples("alpha", START_NS)) == 101
    assert Archive(folder).damage() == []
    path = Archive(folder).path("samples", "alpha", START_NS)
    shutil.copy(Archive(written).path("samples", "alpha", START_NS), path)
    assert Archive(folder).damage() == [f"{path}: is another one than was written"]
    assert scrubbed(folder) == 1
    assert "it can be read, and stays" in caplog.text
    assert path.exists()
    assert scrubbed(folder) == 0


@pytest.mark.parametrize("damage", ["remove", "cut"])
def test_a_line_that_is_missing_in_the_ledger_shows(folder, damage):
    ledger = folder / "days" / "alpha-days.jsonl"
    lines = ledger.read_text().splitlines()
    ledger.write_text("\n".join(lines[:-1] if damage == "cut" else [*lines[:2], *lines[3:]]) + "\n")
    (told,) = [told for told in Archive(folder).damage() if str(ledger) in told]
    assert told.endswith("lines at its end are lost" if damage == "cut" else "line 3 is not what was written")


@pytest.mark.parametrize("damage", ["remove", "cut", "change", "all"])
def test_a_damaged_ledger_is_put_aside_and_told_once_and_goes_on_with_its_whole_lines(folder, caplog, damage):
    ledger = folder / "days" / "alpha-days.jsonl"
    lines = ledger.read_text().splitlines()
    left = {
        "remove": [*lines[:2], *lines[3:]],
        "cut": lines[:-1],
        "change": [lines[0].replace("write", "wrote"), *lines[1:]],
        "all": [],
    }[damage]
    ledger.write_text("".join(f"{line}\n" for line in left))
    assert scrubbed(folder) == 1
    assert "its list of daily files is put aside" in caplog.text
    assert ledger.with_name(f"{ledger.name}.refused").exists()
    assert Archive(folder).damage() == []
    assert len(DayLedger(folder).expected("alpha")) == 8
    assert scrubbed(folder) == 0


def test_a_file_that_is_missing_beside_a_damaged_ledger_shows(folder):
    ledger = folder / "days" / "alpha-days.jsonl"
    lines = ledger.read_text().splitlines()
    ledger.write_text("".join(f"{line}\n" for line in [*lines[:2], "", *lines[2:]]))
    min((folder / "samples" / "station=alpha").iterdir()).unlink()
    assert scrubbed(folder) == 2


def test_what_was_deleted_for_its_age_or_became_minutes_is_not_missing(tmp_path):
    with contextlib.closing(FolderStore(tmp_path, downsample_after_days=4, keep_days=8)) as store:
        write(store, range(12))
        assert Archive(tmp_path).days_ns("minutes", "alpha")
    assert Archive(tmp_path).damage() == []
    assert scrubbed(tmp_path) == 0


def test_files_of_an_earlier_version_are_taken_in_by_the_first_look_through(folder):
    shutil.rmtree(folder / "days")
    assert Archive(folder).damage() == []
    assert scrubbed(folder) == 0
    path = min((folder / "samples" / "station=alpha").iterdir())
    path.unlink()
    assert Archive(folder).damage() == [f"{path}: is missing"]


def test_a_full_disk_does_not_keep_what_is_too_old(folder):
    kept = Archive(folder)
    shutil.rmtree(folder / "days")
    (folder / "days").write_text("")  # nothing can be written there
    path = kept.path("samples", "alpha", START_NS)
    with pytest.raises(archive.StoreError, match="cannot be written"):
        kept.delete("samples", "alpha", START_NS)
    assert not path.exists()


@pytest.mark.parametrize("day", [3, 4])
def test_a_damaged_file_of_a_day_or_of_the_day_before_is_put_aside_and_holds_no_maintenance_up(folder, caplog, day):
    """Day 4 becomes a file, whose hours ask for the end of day 3; day 3 has a file, and gets a late sample."""
    path = Archive(folder).path("samples", "alpha", START_NS + 3 * DAY_NS)
    path.write_bytes(path.read_bytes()[:-200])
    late = Sample(station="alpha", seq=9_000, time=START_NS + day * DAY_NS + 5_000 * NS_PER_S, pumps=())
    with contextlib.closing(FolderStore(folder)) as store:
        store.write(Batch(samples=[pack("alpha", late)]))
        write(store, [6])
        filed_ns = store.archive.days_ns("samples", "alpha")
        assert filed_ns == [START_NS + number * DAY_NS for number in (0, 1, 2, 3, 4) if (number, day) != (3, 4)]
        assert store.damages == 1
    assert path.with_name(f"{path.name}.refused").exists()
    assert f"{path}: cannot be read" in caplog.text


def test_a_disk_that_spoils_what_is_just_written_is_asked_again_in_the_next_pause(folder, monkeypatch):
    write_table = pyarrow.parquet.write_table

    def spoil(table, file, **options):
        write_table(table, file, **options)
        file.seek(-4, 2)
        file.write(bytes(4))

    with contextlib.closing(FolderStore(folder)) as store:
        with monkeypatch.context() as patch:
            patch.setattr(pyarrow.parquet, "write_table", spoil)
            with pytest.raises(StoreError, match="cannot be read"):
                write(store, [6])
        write(store, [])
        assert len(store.archive.samples("alpha", START_NS + 4 * DAY_NS)) == 100


@pytest.mark.parametrize("form", ["samples", "tens"])
def test_a_day_without_rows_is_damaged(folder, form):
    path = sorted((folder / form / "station=alpha").iterdir())[1]
    pyarrow.parquet.write_table(pyarrow.parquet.read_table(path).slice(0, 0), path)
    assert f"{path}: holds no row" in Archive(folder).damage()


def test_a_day_that_is_listed_and_not_found_becomes_no_file(tmp_path, monkeypatch):
    """As where a disk has changed what the database finds rows by."""
    with contextlib.closing(FolderStore(tmp_path)) as store:
        checks: list[int] = []
        monkeypatch.setattr(store.live, "samples", lambda *_: Samples.of_rows([]))
        monkeypatch.setattr(store.file, "check", lambda: checks.append(1))
        write(store, range(6))
        assert len(checks) > 1, "before the first day, and where nothing is found"
    assert Archive(tmp_path).days_ns("samples", "alpha") == []
