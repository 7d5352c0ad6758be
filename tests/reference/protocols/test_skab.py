"""The SKAB importer against the files themselves, read here by the csv module.

Units: the rig's flow is given in L/min, 1 L/min = 0.06 m³/h. Row and label counts are those of the published files
(commit b2c0d46 of waico/SKAB).
"""

import csv
import gzip
from datetime import UTC, datetime

import numpy as np
import pytest

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.importers import IMPORTERS
from wetwell.protocols.recordings.importers.skab import read_skab
from wetwell.protocols.recordings.recording import read_recording, write_recording

HEADER = "datetime;Current;Volume Flow RateRMS;anomaly;changepoint\n"


def plain_rows(path):
    with gzip.open(path, "rt", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, delimiter=";"))


@pytest.mark.real_data
def test_valve_file(real_data):
    path = real_data / "skab" / "valve1" / "0.csv.gz"
    recording, rows = read_skab(path), plain_rows(path)
    assert len(recording) == len(rows) == 1147
    assert recording.pumps == 1
    assert list(recording.columns) == ["pump1_flow_m3h"]
    litres_min = np.array([float(row["Volume Flow RateRMS"]) for row in rows])
    assert recording.columns["pump1_flow_m3h"] == pytest.approx(litres_min / 1000.0 * 60.0, rel=1e-12)
    assert recording.columns["pump1_flow_m3h"].mean() == pytest.approx(1.92, abs=0.01)
    assert recording.truth["truth_anomaly"].tolist() == [float(row["anomaly"]) for row in rows]
    assert recording.truth["truth_changepoint"].tolist() == [float(row["changepoint"]) for row in rows]
    assert recording.truth["truth_anomaly"].sum() == 401
    assert recording.truth["truth_changepoint"].sum() == 4
    stamps = [datetime.strptime(row["datetime"], "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC) for row in rows]
    assert recording.time_ns.tolist() == [int(stamp.timestamp()) * 10**9 for stamp in stamps]
    assert np.isnan(recording.column("pump1_head_m")).all()
    assert np.isnan(recording.column("level_m")).all()


@pytest.mark.real_data
def test_anomaly_free_file_has_no_labels(real_data):
    recording = read_skab(real_data / "skab" / "anomaly-free" / "anomaly-free.csv.gz")
    assert len(recording) == 9405
    assert recording.truth == {}
    assert list(recording.columns) == ["pump1_flow_m3h"]
    assert np.nanmean(recording.columns["pump1_flow_m3h"]) == pytest.approx(125.237 * 0.06, abs=0.001)


@pytest.mark.real_data
def test_every_file_is_read_and_survives_a_round_trip(real_data, tmp_path):
    paths = sorted((real_data / "skab").glob("*/*.csv.gz"))
    assert len(paths) == 35
    rows = dict.fromkeys(("anomaly-free", "valve1", "valve2", "other"), 0)
    for path in paths:
        recording = read_skab(path)
        rows[path.parent.name] += len(recording)
        write_recording(recording, tmp_path / "skab.csv.gz")
        again = read_recording(tmp_path / "skab.csv.gz")
        assert again.time_ns.tolist() == recording.time_ns.tolist()
        assert again.columns["pump1_flow_m3h"].tobytes() == recording.columns["pump1_flow_m3h"].tobytes()
    assert rows["valve1"] == 18_160
    assert rows["valve2"] == 4_312
    assert rows["anomaly-free"] == 9_405


def test_importer_is_registered():
    assert IMPORTERS["skab"] is read_skab


def test_made_up_file(tmp_path):
    path = tmp_path / "1.csv"
    path.write_text(
        HEADER + "2020-03-09 10:14:33;1.3;32.0;0.0;1.0\n2020-03-09 10:14:35;1.3;;1.0;0.0\n", encoding="utf-8"
    )
    recording = read_skab(path)
    assert recording.columns["pump1_flow_m3h"][0] == pytest.approx(1.92)
    assert np.isnan(recording.columns["pump1_flow_m3h"][1])
    assert np.diff(recording.time_ns).tolist() == [2 * 10**9]
    assert recording.truth["truth_anomaly"].tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "Empty CSV file"),
        (
            "datetime;Current\n2020-03-09 10:14:33;1.3\n",
            "column 'Volume Flow RateRMS' is missing, is this a SKAB file?",
        ),
        ("time,level_m\n2020-03-09T10:14:33Z,1.3\n", "column 'datetime' is missing, is this a SKAB file?"),
        (HEADER + "soon;1.3;32.0;0.0;1.0\n", "soon"),
        (HEADER + "2020-03-09 10:14:33;1.3;much;0.0;1.0\n", "much"),
        (HEADER + "2020-03-09 10:14:33;1.3\n", "Expected 5 columns, got 2"),
        (HEADER + ";1.3;32.0;0.0;1.0\n2020-03-09 10:14:33;1.3;32.0;0.0;1.0\n", "'datetime', row 1: is empty"),
    ],
)
def test_bad_file_gives_one_line(tmp_path, text, rule):
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError) as caught:
        read_skab(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert rule in line
    assert "\n" not in line


def test_missing_file(tmp_path):
    with pytest.raises(RecordingError, match=r"none\.csv: cannot be read"):
        read_skab(tmp_path / "none.csv")
