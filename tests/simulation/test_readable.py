"""What can be read of a damaged history by whoever looks at its files alone."""

import contextlib

import pytest
from readable import readable_in

from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.rows import pack
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Batch

ROWS = 500
STEP_NS = 600 * NS_PER_S


@pytest.fixture
def history(tmp_path):
    pump = PumpReading(frequency_hz=50.0, flow_m3h=90.0, head_m=12.0, power_kw=5.0, running=True)
    samples = [
        Sample(station="alpha", seq=number, time=number * STEP_NS, level_m=1.0 + number / ROWS, pumps=(pump,))
        for number in range(ROWS)
    ]
    with contextlib.closing(FolderStore(tmp_path / "history")) as store:
        store.write(Batch([pack("alpha", sample) for sample in samples]))
        while store.maintain(10 * DAY_NS):
            pass
    return tmp_path / "history", samples


def keys(samples) -> set[tuple[str, int, int]]:
    return {("alpha", sample.time, sample.seq) for sample in samples}


def test_all_of_a_whole_history_can_be_read_in_files_and_database(history):
    folder, samples = history
    assert list(folder.glob("samples/*/*.parquet"))
    assert readable_in(folder) == keys(samples)


def test_a_row_with_a_bit_that_flipped_cannot_be_read_and_the_others_can(history):
    folder, samples = history
    content = bytearray((folder / "live.sqlite").read_bytes())
    content[content.index(pack("alpha", samples[-1]).data) + 3] ^= 1
    (folder / "live.sqlite").write_bytes(content)
    assert readable_in(folder) == keys(samples[:-1])


def test_a_daily_file_in_the_place_of_another_day_cannot_be_read(history):
    folder, samples = history
    file = min(folder.glob("samples/*/*.parquet"))
    file.replace(file.with_name("2031-01-01.parquet"))
    day = {sample for sample in keys(samples) if sample[1] < DAY_NS}
    assert readable_in(folder) == keys(samples) - day


def test_a_daily_file_in_the_place_of_that_of_another_station_cannot_be_read(history):
    folder, samples = history
    file = min(folder.glob("samples/*/*.parquet"))
    other = folder / "samples" / "station=beta"
    other.mkdir()
    file.replace(other / file.name)
    day = {sample for sample in keys(samples) if sample[1] < DAY_NS}
    assert readable_in(folder) == keys(samples) - day


def test_a_daily_file_with_a_column_of_another_name_is_not_what_was_written(history):
    """No checksum guards its names: a column that has lost its own leaves the others, and rows without a value."""
    folder, samples = history
    file = min(folder.glob("samples/*/*.parquet"))
    content = file.read_bytes()
    assert b"pump1_head_m" in content
    file.write_bytes(content.replace(b"pump1_head_m", b"pump1_heaf_m"))
    day = {sample for sample in keys(samples) if sample[1] < DAY_NS}
    assert readable_in(folder) == keys(samples) - day
