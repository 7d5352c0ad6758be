"""Station and kind of values that travel with a recording."""

import duckdb
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet
import pytest

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.recording import (
    SUFFIXES,
    Recording,
    read_recording,
    recording_writer,
    write_recording,
)

ROWS = {"time_ns": np.array([0, 10**9]), "columns": {"pump1_flow_m3h": np.array([1.0, 2.0])}}


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("said", [{"station": "north"}, {"value": "mean"}, {"station": "PS-07", "value": "held"}])
def test_what_is_said_comes_back(tmp_path, suffix, said):
    path = tmp_path / f"r{suffix}"
    with recording_writer(path) as write:
        write(Recording(**ROWS, **said))
        write(Recording(**ROWS, **said))
    again = read_recording(path)
    assert {"station": again.station, "value": again.value} == {"station": None, "value": "instant"} | said
    assert again.columns["pump1_flow_m3h"].tolist() == [1.0, 2.0, 1.0, 2.0]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_nothing_is_written_where_nothing_is_said(tmp_path, suffix):
    path = tmp_path / f"r{suffix}"
    write_recording(Recording(**ROWS), path)
    assert read_recording(path).station is None
    if suffix == ".csv":
        assert path.read_text(encoding="utf-8").startswith("time,pump1_flow_m3h\n")
    if suffix == ".parquet":
        assert pa.parquet.read_schema(path).metadata is None


def test_the_first_line_of_a_csv_is_a_comment(tmp_path):
    path = tmp_path / "r.csv"
    write_recording(Recording(**ROWS, station="north", value="mean"), path)
    assert path.read_text(encoding="utf-8").splitlines()[0] == "# wetwell station=north value=mean"


def test_a_spreadsheet_may_have_saved_the_first_line(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("\ufeff# wetwell station=north,\ntime,pump1_flow_m3h\n2025-01-31T06:00:00Z,1\n", encoding="utf-8")
    assert read_recording(path).station == "north"


def test_other_readers_pass_over_the_first_line(tmp_path):
    path = tmp_path / "r.csv"
    write_recording(Recording(**ROWS, station="north"), path)
    assert pd.read_csv(path, comment="#")["pump1_flow_m3h"].tolist() == [1.0, 2.0]
    values = duckdb.read_csv(str(path), comment="#").select("pump1_flow_m3h").fetchall()
    assert values == [(1.0,), (2.0,)]


def test_rows_are_counted_from_the_header_on(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("# wetwell station=north\ntime,pump1_flow_m3h\n2025-01-31T06:00:00Z,1\n2025-01-31T06:00:01Z,x\n")
    with pytest.raises(RecordingError, match="column 'pump1_flow_m3h', row 2: "):
        read_recording(path)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_unknown_kind_of_value_is_refused(tmp_path, suffix):
    path = tmp_path / f"r{suffix}"
    path.write_text("# wetwell value=guess\ntime,pump1_flow_m3h\n2025-01-31T06:00:00Z,1\n")
    if suffix == ".parquet":
        table = pa.table({"time": pa.array([0], pa.timestamp("ns", "UTC")), "pump1_flow_m3h": [1.0]})
        pa.parquet.write_table(table.replace_schema_metadata({"wetwell.value": "guess"}), path)
    with pytest.raises(
        RecordingError, match=r"r\.(csv|parquet): value: got 'guess', must be one of instant, mean, held"
    ):
        read_recording(path)
