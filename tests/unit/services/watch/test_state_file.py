"""The state on disk: read back as it was; damaged, foreign or outdated files begin anew and are told."""

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.services.stations import find_station
from wetwell.services.watch.state_file import WatchFile
from wetwell.sim2real.watch.state import KeptLook, KeptShift, WatchState

ALPHA = find_station("alpha")
LOOK = KeptLook(
    start_ns=0, end_ns=9, gap={"flow": 1.2}, group="flow/1/steady", matters=0.4, interval=(0.3, 0.5), drifting={}
)
STATE = WatchState(
    station=ALPHA,
    looked_ns=9,
    begins_ns=10,
    reference={"flow/1/steady": KeptShift(mean=0.1, error=0.01, cycles=50)},
    looks=(LOOK,),
)


def test_what_was_saved_is_read_back(tmp_path):
    WatchFile(tmp_path, ALPHA).save(STATE)
    assert WatchFile(tmp_path, ALPHA).load() == STATE


def test_without_a_folder_nothing_is_kept():
    file = WatchFile(None, ALPHA)
    file.save(STATE)
    assert file.load() == WatchState(station=ALPHA)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda data: data[:-70],
        lambda data: b"{}" + data,
        lambda data: data[:0],
        lambda data: data.replace(b"0.4", b"0.5"),
    ],
)
def test_a_damaged_file_is_put_aside(tmp_path, caplog, spoil):
    file = WatchFile(tmp_path, ALPHA)
    file.save(STATE)
    path = tmp_path / "alpha.gap.json"
    path.write_bytes(spoil(path.read_bytes()))
    assert file.load() == WatchState(station=ALPHA)
    assert "begins anew" in caplog.text
    assert [each.name for each in tmp_path.iterdir()] == ["alpha.gap.refused"]


def test_another_station_file_begins_anew_where_the_last_look_ended(tmp_path, caplog):
    WatchFile(tmp_path, ALPHA).save(STATE)
    other = ALPHA.model_copy(update={"sump": ALPHA.sump.model_copy(update={"area_m2": 9.0})})
    assert WatchFile(tmp_path, other).load() == WatchState(station=other, begins_ns=10)
    assert "'alpha'" in caplog.text


def test_a_folder_that_cannot_be_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match=r"watch\.state_dir"):
        WatchFile(tmp_path / "file", ALPHA).load()
