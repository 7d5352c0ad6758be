"""The zone of stamps without one, and recordings of other stations, in the reader and in every command."""

from dataclasses import replace
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.recordings.importers.tables.parquet_file import ParquetFile
from wetwell.protocols.recordings.reading import Reading
from wetwell.protocols.recordings.recording import Recording, read_recording, write_recording
from wetwell.protocols.timestamps import from_iso

HELSINKI = ZoneInfo("Europe/Helsinki")
ROWS = Recording(
    time_ns=np.array([0, 10**9]),
    columns={f"pump{pump}_flow_m3h": np.array([1.0, 2.0]) for pump in (1, 2, 3)},
    station="alpha",
)


def written(path, *times):
    path.write_text("time,pump1_flow_m3h\n" + "".join(f"{time},1\n" for time in times), encoding="utf-8")
    return path


def test_local_stamps_get_their_zone_and_others_keep_theirs(tmp_path):
    path = written(tmp_path / "r.csv", "2025-01-31 08:00:00", "2025-01-31T06:00:01Z", "2025-07-31 08:00:00")
    expected = ["2025-01-31T06:00:00Z", "2025-01-31T06:00:01Z", "2025-07-31T05:00:00Z"]
    assert read_recording(path, HELSINKI).time_ns.tolist() == [from_iso(text) for text in expected]


def damaged_parquet(path, **columns):
    """A file in whose schema one letter of "Xay" is no UTF-8."""
    pa.parquet.write_table(pa.table(columns), path, store_schema=False)
    path.write_bytes(path.read_bytes().replace(b"Xay", b"\xffay"))
    return path


def test_a_name_in_parquet_that_is_no_text_gives_one_line(tmp_path):
    path = damaged_parquet(tmp_path / "r.parquet", time=["2025-01-31T06:00:00Z"], Xay=[1.0])
    with pytest.raises(RecordingError, match=r"^[^\n]*r\.parquet: [^\n]*utf-8[^\n]*$"):
        read_recording(path)
    with pytest.raises(RecordingError, match=r"^[^\n]*r\.parquet: [^\n]*utf-8[^\n]*$"):
        ParquetFile(path, None)


def test_a_column_that_stands_twice_in_parquet_is_refused(tmp_path):
    table = pa.Table.from_arrays([pa.array([1.0])] * 2, names=["level_m", "level_m"])
    pa.parquet.write_table(table, tmp_path / "r.parquet")
    with pytest.raises(RecordingError, match=r"r\.parquet: column 'level_m' stands twice"):
        read_recording(tmp_path / "r.parquet")


def test_local_stamps_of_parquet_get_their_zone(tmp_path):
    time = pa.array([from_iso("2025-01-31T08:00:00Z")], pa.timestamp("ns"))
    pa.parquet.write_table(pa.table({"time": time, "pump1_flow_m3h": [1.0]}), tmp_path / "r.parquet")
    assert read_recording(tmp_path / "r.parquet", HELSINKI).time_ns.tolist() == [from_iso("2025-01-31T06:00:00Z")]


def test_the_hour_that_comes_twice_is_told_by_the_order_of_the_rows(tmp_path):
    times = [f"2024-10-27 03:{minute:02}:00" for minute in (0, 30)]
    told = read_recording(written(tmp_path / "r.csv", *times, *times), HELSINKI)
    assert np.diff(told.time_ns).tolist() == [1800 * 10**9] * 3


@pytest.mark.parametrize(
    ("times", "rule"),
    [
        (["2024-10-27 03:00:00"], "column 'time': 1 stamps lie in an hour that comes twice in Europe/Helsinki"),
        (
            ["2024-03-31 02:59:59", "2024-03-31 03:30:00"],
            "column 'time', row 2: got '2024-03-31 03:30:00', in an hour that clocks of Europe/Helsinki leave out",
        ),
    ],
)
def test_stamps_that_a_local_clock_does_not_tell_are_refused(tmp_path, times, rule):
    with pytest.raises(RecordingError) as caught:
        read_recording(written(tmp_path / "r.csv", *times), HELSINKI)
    assert rule in str(caught.value)


@pytest.mark.parametrize("name", ["Mars/Base", "", "/etc/passwd", "a\0b"])
def test_a_zone_that_there_is_not_is_refused(name):
    with pytest.raises(ConfigError, match="--time-zone: got "):
        Reading.said(name)


def test_a_recording_of_the_station_or_of_nobody_carries_its_name(tmp_path, alpha):
    for number, name in enumerate(("alpha", None)):
        path = tmp_path / f"{number}.parquet"
        write_recording(replace(ROWS, station=name), path)
        assert Reading().read_of(path, alpha).station == "alpha"


def test_another_station_is_refused_unless_it_is_overruled(tmp_path, alpha):
    path = tmp_path / "r.csv"
    write_recording(replace(ROWS, station="beta"), path)
    with pytest.raises(RecordingError) as caught:
        Reading().read_of(path, alpha)
    assert str(caught.value) == (
        f"{path}: is of station 'beta', not of 'alpha' (--as-station takes it for one of 'alpha')"
    )
    assert Reading(as_station=True).read_of(path, alpha).station == "alpha"


@pytest.mark.parametrize("pumps", [(1, 2), (1, 2, 3, 4)])
def test_another_number_of_pumps_is_refused_whatever_is_said(tmp_path, alpha, pumps):
    path = tmp_path / "r.csv"
    columns = {f"pump{pump}_flow_m3h": np.array([1.0, 2.0]) for pump in pumps}
    write_recording(replace(ROWS, columns=columns), path)
    with pytest.raises(RecordingError, match=f"has {len(pumps)} pumps, station 'alpha' has 3"):
        Reading(as_station=True).read_of(path, alpha)


COMMANDS = {
    "detect": ["detect", "--out", "out"],
    "backtest": ["backtest", "--out", "out", "--workers", "1"],
    "calibrate": ["calibrate", "--out", "out"],
    "validate": ["validate"],
    "gap diagnose": ["gap", "diagnose", "--out", "out"],
    "gap replay": ["gap", "replay", "--out", "out.csv"],
    "kpi": ["kpi"],
    "prepare": ["prepare", "--out", "out.csv"],
    "import": ["import", "--data", "out"],
    "replay": ["replay"],
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# wetwell station=beta\n{head}2025-01-31T06:00:00Z,1,1,1\n", "is of station 'beta', not of 'alpha'"),
        ("{head}2025-01-31 06:00:00,1,1,1\n", "column 'time', row 1: got '2025-01-31 06:00:00' without a zone"),
        ("{head}", "has no rows"),
    ],
    ids=["station", "zone", "empty"],
)
def test_every_command_refuses_in_one_line(command, text, said, run_wetwell, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    recording = tmp_path / "field.csv"
    recording.write_text(text.format(head="time,pump1_flow_m3h,pump2_flow_m3h,pump3_flow_m3h\n"), encoding="utf-8")
    assert run_wetwell(*command, "--station", "alpha", "--recording", "field.csv") == 2
    told = capsys.readouterr().err.splitlines()
    assert [line for line in told if line.startswith("wetwell: ")] == told[-1:]
    assert told[-1].startswith(f"wetwell: field.csv: {said}") or f"field.csv: {said}" in told[-1]
    assert not (tmp_path / "out").is_file()
    assert not (tmp_path / "out.csv").exists()


NEEDS_STATION = [name for name in COMMANDS if name not in {"kpi", "prepare", "import"}]


@pytest.mark.parametrize("name", [*NEEDS_STATION, "simulate", "dataset", "export"])
def test_no_offline_command_takes_a_station_for_granted(name, run_wetwell, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(ROWS, tmp_path / "field.csv")
    command = COMMANDS.get(name, [name, "--out", "out.csv"])
    source = ["--recording", "field.csv"] if name in COMMANDS else []
    assert run_wetwell(*command, *source) == 2
    assert "--station" in capsys.readouterr().err


def test_import_files_under_the_station_of_the_recording(run_wetwell, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(ROWS, tmp_path / "own.csv")
    write_recording(replace(ROWS, station=None), tmp_path / "nobody.csv")
    command = ["import", "--data", "history", "--json", "--recording"]
    assert run_wetwell(*command, "own.csv") == 0
    assert '"station": "alpha"' in capsys.readouterr().out
    assert run_wetwell(*command, "nobody.csv") == 2
    assert "nobody.csv: does not say its station: give --station" in capsys.readouterr().err
    assert run_wetwell(*command, "own.csv", "--station", "beta") == 2
    assert "own.csv: is of station 'alpha', not of 'beta'" in capsys.readouterr().err
    assert run_wetwell(*command, "own.csv", "--station", "beta", "--as-station") == 0
    assert '"station": "beta"' in capsys.readouterr().out


def test_all_that_is_made_of_a_recording_carries_its_station(run_wetwell, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    station, source = ["--station", "alpha"], ["--recording", "made.csv.gz"]
    assert run_wetwell("simulate", *station, "--days", "0.2", "--seed", "3", "--out", "made.csv.gz") == 0
    assert run_wetwell("prepare", *source, "--out", "prepared.csv") == 0
    assert run_wetwell("gap", "replay", *station, *source, "--out", "replayed.parquet") == 0
    assert run_wetwell("validate", *station, *source, "--out", "simulated.csv") == 0
    assert run_wetwell("import", *source, "--data", "history") == 0
    assert run_wetwell("export", *station, "--data", "history", "--out", "exported.csv") == 0
    made = ["made.csv.gz", "prepared.csv", "replayed.parquet", "simulated.csv", "exported.csv"]
    assert {name: read_recording(tmp_path / name).station for name in made} == dict.fromkeys(made, "alpha")
