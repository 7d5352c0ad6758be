"""Recordings on disk: what is read, what is refused in one line, and that a file is whole or absent."""

import gzip
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings import recording as recording_module
from wetwell.protocols.recordings.recording import SUFFIXES, Recording, read_recording, write_recording
from wetwell.protocols.timestamps import NS_PER_S, from_iso

START_NS = from_iso("2025-01-31T06:00:00Z")
every_suffix = pytest.mark.parametrize("suffix", SUFFIXES)


def small_recording(**changes):
    parts = {
        "time_ns": START_NS + NS_PER_S * np.array([0, 1, 1, 0, 5]),
        "columns": {
            "level_m": np.array([1.0, np.nan, 0.1 + 0.2, -0.0, 1e-300]),
            "pump1_frequency_hz": np.array([50.0, 0.0, 49.99, np.nan, 50.0]),
            "pump1_flow_m3h": np.array([200.0, np.nan, np.nan, np.nan, np.inf]),
            "pump1_head_m": np.full(5, np.nan),
            "pump2_running": np.array([0.0, 1.0, 1.0, np.nan, 0.0]),
        },
        "truth": {"truth_state": np.array(["normal"] * 4 + ["pump_fault"]), "truth_level_m": np.linspace(0, 1, 5)},
    }
    return Recording(**(parts | changes))


def written(tmp_path, text, name="recording.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def in_parquet(tmp_path, columns):
    path = tmp_path / "recording.parquet"
    table = columns if isinstance(columns, pa.Table) else pa.table(columns)
    pa.parquet.write_table(table, path)
    return path


def stamps(*seconds, unit="ns", zone="UTC"):
    return pa.array(seconds, pa.int64()).cast(pa.timestamp("s", tz=zone)).cast(pa.timestamp(unit, tz=zone))


@every_suffix
def test_round_trip(tmp_path, suffix):
    recording, path = small_recording(), tmp_path / f"r{suffix}"
    write_recording(recording, path)
    again = read_recording(path)
    assert again.time_ns.tolist() == recording.time_ns.tolist()
    assert again.time_ns.dtype == np.int64
    assert list(again.columns) == list(recording.columns)
    for name, column in recording.columns.items():
        assert again.columns[name].dtype == np.float64
        np.testing.assert_array_equal(again.columns[name], column)
        assert (
            np.signbit(again.columns[name][~np.isnan(column)]).tolist()
            == np.signbit(column[~np.isnan(column)]).tolist()
        )
    assert again.truth["truth_state"].tolist() == recording.truth["truth_state"].tolist()
    np.testing.assert_array_equal(again.truth["truth_level_m"], recording.truth["truth_level_m"])
    assert again.ignored == ()
    assert again.pumps == 2


@every_suffix
def test_the_same_recording_gives_the_same_bytes(tmp_path, monkeypatch, suffix):
    """At another time and under another name."""
    first, second = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    write_recording(small_recording(), first)
    monkeypatch.setattr(time, "time", lambda: 2e9)
    write_recording(small_recording(), second)
    assert first.read_bytes() == second.read_bytes()
    write_recording(small_recording(time_ns=START_NS + NS_PER_S * np.arange(5)), second)
    assert first.read_bytes() != second.read_bytes()


@every_suffix
def test_a_recording_without_rows_is_refused(tmp_path, suffix):
    path = tmp_path / f"r{suffix}"
    empty = Recording(time_ns=np.array([], dtype=np.int64), columns={"pump1_flow_m3h": np.array([])})
    write_recording(empty, path)
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert str(caught.value) == f"{path}: has no rows"


def test_csv_text_is_plain(tmp_path):
    path = tmp_path / "r.csv"
    write_recording(small_recording(), path)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 6
    names = [name.strip('"') for name in lines[0].split(",")]
    assert names[:3] == ["time", "level_m", "pump1_frequency_hz"]
    assert lines[1].startswith("2025-01-31T06:00:00Z,1,50,200,nan,0,normal")


@every_suffix
@pytest.mark.parametrize("digits_ns", [1, 1_000, 1_000_000])
def test_stamps_under_a_second_lose_nothing(tmp_path, suffix, digits_ns):
    time_ns = START_NS + digits_ns * np.array([0, 1, 999])
    write_recording(Recording(time_ns=time_ns, columns={"pump1_flow_m3h": np.zeros(3)}), tmp_path / f"r{suffix}")
    assert read_recording(tmp_path / f"r{suffix}").time_ns.tolist() == time_ns.tolist()


def test_unknown_columns_are_listed_and_truth_is_kept_apart(tmp_path):
    text = (
        "time,remark,level_m,pump1_flow_m3h,pump0_flow_m3h,pump01_head_m,pump1_torque_nm,truth_x,truth_note,truth_nothing\n"
        "2025-01-31T06:00:00Z,fine,1,2,3,4,5,6,ok,\n"
    )
    recording = read_recording(written(tmp_path, text))
    assert list(recording.columns) == ["level_m", "pump1_flow_m3h"]
    assert recording.ignored == ("remark", "pump0_flow_m3h", "pump01_head_m", "pump1_torque_nm")
    assert sorted(recording.truth) == ["truth_note", "truth_nothing", "truth_x"]
    assert recording.truth["truth_x"].tolist() == [6]
    assert recording.truth["truth_note"].tolist() == ["ok"]
    assert not any(name.startswith("truth_") for name in recording.columns)


@pytest.mark.parametrize("empty", ["", "nan", "NaN", "NA", "null"])
def test_empty_and_nan_are_no_value(tmp_path, empty):
    text = f"time,pump1_flow_m3h,level_m\n2025-01-31T06:00:00Z,{empty},1\n2025-01-31T06:00:01Z,2,\n"
    recording = read_recording(written(tmp_path, text))
    assert np.isnan(recording.columns["pump1_flow_m3h"]).tolist() == [True, False]
    assert np.isnan(recording.columns["level_m"]).tolist() == [False, True]


@pytest.mark.parametrize(
    "text",
    [
        "time,pump1_flow_m3h\r\n2025-01-31T06:00:00Z,2\r\n",
        "\ufefftime,pump1_flow_m3h\n2025-01-31T06:00:00Z,2\n",
        '"time","pump1_flow_m3h"\n"2025-01-31T06:00:00Z","2"\n',
        "pump1_flow_m3h,time\n2,2025-01-31T06:00:00Z",
        "time,pump1_flow_m3h\n2025-01-31 06:00:00Z,2\n\n",
        "time,pump1_flow_m3h\n2025-01-31T07:00:00+01:00,2.0e0\n",
    ],
    ids=["windows", "byte order mark", "quoted", "no last line end", "blank and empty line", "zone"],
)
def test_dialects_of_csv(tmp_path, text):
    recording = read_recording(written(tmp_path, text))
    assert recording.time_ns.tolist() == [START_NS]
    assert recording.columns["pump1_flow_m3h"].tolist() == [2.0]


@pytest.mark.parametrize(
    "time",
    [
        stamps(0, 60, unit="s"),
        stamps(0, 60, unit="us"),
        stamps(0, 60, unit="ms", zone="Europe/Berlin"),
        pa.array(["1970-01-01T00:00:00Z", "1970-01-01T00:01:00Z"]),
    ],
    ids=["s", "us", "other zone", "texts"],
)
def test_parquet_of_other_origin(tmp_path, time):
    columns = {"time": time, "pump1_running": [True, False], "pump1_flow_m3h": pa.array([None, 3], pa.int32())}
    recording = read_recording(in_parquet(tmp_path, columns))
    assert recording.time_ns.tolist() == [0, 60 * NS_PER_S]
    assert recording.time_ns.dtype == np.int64
    assert recording.columns["pump1_running"].tolist() == [1.0, 0.0]
    assert np.isnan(recording.columns["pump1_flow_m3h"][0])
    assert recording.columns["pump1_flow_m3h"][1] == 3.0


ROW = "2025-01-31T06:00:00Z"
PACKED = gzip.compress(f"time,pump1_flow_m3h\n{ROW},1\n".encode() * 500)
BAD_FILES = {
    "empty": ("r.csv", "", "Empty CSV file"),
    "no time": ("r.csv", "level_m,pump1_flow_m3h\n1,2\n", "column 'time' is missing: `wetwell convert`"),
    "an export": ("r.csv", "Zeit;P1\n1.2.2025 06:00;1,5\n", "no column 'time', so is no recording"),
    "a title over an export": ("r.csv", "Station 7\nZeit,P1\n", "no column 'time', so is no recording"),
    "an export, far not UTF-8": (
        "r.csv",
        ("Zeit;P1\n" + "1.2.2025 06:00;1\n" * 2000 + "1.2.2025 06:00;ö\n").encode("latin-1"),
        "`wetwell convert`",
    ),
    "no pump": ("r.csv", f"time,level_m\n{ROW},1\n", "no pump column such as 'pump1_flow_m3h' found"),
    "column twice": ("r.csv", "time,level_m,level_m\n", "column 'level_m' stands twice"),
    "word in a number": (
        "r.csv",
        f"time,pump1_flow_m3h\n{ROW},1\n{ROW},two\n",
        "column 'pump1_flow_m3h', row 2: CSV conversion error to double: invalid value 'two'",
    ),
    "row too short": ("r.csv", f"time,pump1_flow_m3h\n{ROW},1\n{ROW}\n", "row 2: Expected 2 columns, got 1"),
    "row too long": ("r.csv", f"time,pump1_flow_m3h\n{ROW},1,7\n", "row 1: Expected 2 columns, got 3"),
    "time empty": ("r.csv", f"time,pump1_flow_m3h\n{ROW},1\n,1\n", "column 'time', row 2: got '', must be ISO 8601"),
    "time a word": ("r.csv", "time,pump1_flow_m3h\nsoon,1\n", "column 'time', row 1: got 'soon', must be ISO 8601"),
    "no zone": (
        "r.csv",
        f"time,pump1_flow_m3h\n{ROW},1\n2025-01-31 06:00:01,1\n",
        "got '2025-01-31 06:00:01' without a zone: give --time-zone such as Europe/Helsinki, or use wetwell convert",
    ),
    "header alone": ("r.csv", "time,pump1_flow_m3h\n", "has no rows"),
    "time too far": ("r.csv", "time,pump1_flow_m3h\n9999-01-01T00:00:00Z,1\n", "column 'time', row 1: got '9999-"),
    "time in seconds": ("r.csv", "time,pump1_flow_m3h\n0.5,1\n", "column 'time', row 1: got '0.5', must be ISO 8601"),
    "header not UTF-8": ("r.csv", "time,höhe\n".encode("latin-1"), "`wetwell convert` makes one of it"),
    "data not UTF-8": ("r.csv", f"time,pump1_flow_m3h\n{ROW},1\nö,1\n".encode("latin-1"), "is not UTF-8"),
    "far data not UTF-8": (
        "r.csv",
        ("time,pump1_flow_m3h\n" + f"{ROW},1\n" * 2000 + "ö,1\n").encode("latin-1"),
        "column 'time', row 2001: CSV conversion error to string: invalid UTF8",
    ),
    "other ending": ("r.xlsx", "", "a recording ends in one of .csv, .csv.gz, .parquet"),
    "not gzip": ("r.csv.gz", f"time,pump1_flow_m3h\n{ROW},1\n", "cannot be read: Not a gzipped file"),
    "gzip cut off": ("r.csv.gz", PACKED[: len(PACKED) // 2], "r.csv.gz: "),
    "gzip damaged": ("r.csv.gz", PACKED[:12] + b"\xff" * 20 + PACKED[32:], "while decompressing data"),
    "not Parquet": ("r.parquet", "hello", "r.parquet: "),
    "empty Parquet": ("r.parquet", "", "r.parquet: "),
}


@pytest.mark.parametrize(("name", "text", "rule"), BAD_FILES.values(), ids=BAD_FILES)
def test_bad_file_gives_one_line(tmp_path, name, text, rule):
    path = written(tmp_path, text, name)
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    assert rule in line


BAD_TABLES = {
    "time missing": ({"pump1_flow_m3h": [1.0, 2.0]}, "column 'time' is missing"),
    "time empty": ({"time": stamps(0, None), "pump1_flow_m3h": [1.0, 2.0]}, "column 'time', row 2: is empty"),
    "no zone": (
        {"time": stamps(0, 1, zone=None), "pump1_flow_m3h": [1.0, 2.0]},
        "column 'time', row 1: got '1970-01-01 00:00:00' without a zone: give --time-zone",
    ),
    "time too far": ({"time": stamps(0, 10**12, unit="s"), "pump1_flow_m3h": [1.0, 2.0]}, "column 'time': Casting"),
    "time a number": ({"time": [20250101, 20250102], "pump1_flow_m3h": [1.0, 2.0]}, "column 'time', row 1: got"),
    "time a text": ({"time": ["2025-01-31", None], "pump1_flow_m3h": [1.0, 2.0]}, "column 'time', row 2: got None"),
    "lists": ({"time": stamps(0, 1), "pump1_flow_m3h": [[1.0], [2.0]]}, "column 'pump1_flow_m3h' must hold numbers"),
    "words": ({"time": stamps(0, 1), "pump1_flow_m3h": ["1", "x"]}, "column 'pump1_flow_m3h' must hold numbers"),
    "times": ({"time": stamps(0, 1), "level_m": stamps(0, 1)}, "column 'level_m' must hold numbers"),
    "column twice": (
        pa.table([stamps(0, 1), pa.array([1.0, 2.0]), pa.array([1.0, 2.0])], names=["time", "level_m", "level_m"]),
        "level_m",
    ),
}


@pytest.mark.parametrize(("columns", "rule"), BAD_TABLES.values(), ids=BAD_TABLES)
def test_bad_parquet_gives_one_line(tmp_path, columns, rule):
    path = in_parquet(tmp_path, columns)
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert rule in str(caught.value)


@every_suffix
def test_missing_file_and_folder(tmp_path, suffix):
    with pytest.raises(RecordingError, match=rf"none{suffix}: cannot be read: ") as caught:
        read_recording(tmp_path / f"none{suffix}")
    assert "\n" not in str(caught.value)
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(RecordingError, match=rf"folder{suffix}: "):
        read_recording(tmp_path / f"folder{suffix}")


@every_suffix
def test_a_disk_that_fails_half_way_leaves_nothing(tmp_path, monkeypatch, suffix):
    def half(file, *_rest):
        file.write(b"half of it")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recording_module, "_block_writer", half)
    with pytest.raises(RecordingError, match="cannot be written: No space left on device"):
        write_recording(small_recording(), tmp_path / f"r{suffix}")
    assert list(tmp_path.iterdir()) == []


@every_suffix
@pytest.mark.parametrize(
    "fault", [OSError(28, "No space left on device"), KeyboardInterrupt()], ids=["disk", "Ctrl-C"]
)
def test_a_failed_write_keeps_the_file_that_was_there(tmp_path, monkeypatch, suffix, fault):
    path = tmp_path / f"r{suffix}"
    write_recording(small_recording(), path)
    before = path.read_bytes()

    def half(file, *_rest):
        file.write(b"half of it")
        raise fault

    monkeypatch.setattr(recording_module, "_block_writer", half)
    with pytest.raises((RecordingError, KeyboardInterrupt)):
        write_recording(small_recording(), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_rename_keeps_the_file_that_was_there(tmp_path, monkeypatch):
    path = tmp_path / "r.csv"
    path.write_text("before", encoding="utf-8")

    def refuse(_self, _target):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(RecordingError, match="cannot be written: Operation not permitted"):
        write_recording(small_recording(), path)
    assert path.read_text(encoding="utf-8") == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_cannot_be_written_gives_one_line(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    (tmp_path / "folder.csv").mkdir()
    for path, rule in (
        (tmp_path / "none" / "r.csv", "No such file or directory"),
        (tmp_path / "file" / "r.csv", "Not a directory"),
        (tmp_path / "folder.csv", "Is a directory"),
        (tmp_path / f"{'x' * 255}.csv", "File name too long"),
    ):
        with pytest.raises(RecordingError) as caught:
            write_recording(small_recording(), path)
        assert str(caught.value) == f"{path}: cannot be written: {rule}"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.csv"]
    with pytest.raises(RecordingError, match="ends in one of"):
        write_recording(small_recording(), tmp_path / "r.txt")


def test_text_that_csv_cannot_hold_is_refused(tmp_path):
    odd = small_recording(truth={"truth_note": np.array(["a", "b", "c,d", "e", "f"])})
    with pytest.raises(RecordingError, match=r"r\.csv: cannot be written: "):
        write_recording(odd, tmp_path / "r.csv")
    assert list(tmp_path.iterdir()) == []
    write_recording(odd, tmp_path / "r.parquet")
    assert read_recording(tmp_path / "r.parquet").truth["truth_note"][2] == "c,d"


def test_samples_map_nan_to_none():
    samples = list(small_recording().samples("alpha", first_seq=10))
    assert [sample.seq for sample in samples] == [10, 11, 12, 13, 14]
    assert [sample.time for sample in samples] == small_recording().time_ns.tolist()
    assert [sample.level_m for sample in samples] == [1.0, None, 0.1 + 0.2, 0.0, 1e-300]
    assert {sample.inflow_m3h for sample in samples} == {None}
    assert [sample.pumps[0].flow_m3h for sample in samples[:2]] == [200.0, None]
    assert {sample.pumps[0].head_m for sample in samples} == {None}
    assert [sample.pumps[1].running for sample in samples] == [False, True, True, None, False]
    assert {sample.pumps[1].frequency_hz for sample in samples} == {None}
    assert {sample.station for sample in samples} == {"alpha"}
    assert {len(sample.pumps) for sample in samples} == {2}


def test_samples_of_one_without_first_seq_count_from_zero():
    assert next(iter(small_recording().samples("alpha"))).seq == 0


def test_absent_columns_are_nan_throughout():
    recording = small_recording()
    assert np.isnan(recording.column("inflow_m3h")).all()
    assert recording.column("inflow_m3h").shape == (5,)
    assert recording.column("level_m") is recording.columns["level_m"]
    assert Recording(time_ns=np.array([0]), columns={"level_m": np.array([1.0])}).pumps == 0
