"""How recordings lie in Parquet."""

import io

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest

from wetwell.protocols.recordings.layout import texts_of
from wetwell.protocols.recordings.recording import Recording, read_recording, recording_writer

HEALTHY = np.broadcast_to(np.array("normal"), (4,))
CHANGING = np.array(["normal", "pump_fault", "pump_fault", "normal"])


def block(begin_s, states):
    return Recording(
        time_ns=10**9 * np.arange(begin_s, begin_s + 4),
        columns={"level_m": np.array([1.0, np.nan, -0.0, 5e-324]), "pump1_flow_m3h": np.arange(4.0)},
        truth={"truth_state": states, "truth_known": np.array([True, None, False, True])},
        station="north",
    )


@pytest.mark.parametrize("states", [(HEALTHY, CHANGING), (CHANGING, HEALTHY)], ids=["healthy first", "faulty first"])
def test_a_text_that_stands_for_a_whole_block_goes_with_others(tmp_path, states):
    path = tmp_path / "r.parquet"
    blocks = [block(4 * at, each) for at, each in enumerate(states)]
    with recording_writer(path) as write:
        for each in blocks:
            write(each)
    again = read_recording(path)
    assert again.station == "north"
    assert again.time_ns.tolist() == [10**9 * second for second in range(8)]
    for name in ("level_m", "pump1_flow_m3h"):
        assert again.columns[name].tobytes() == np.concatenate([each.columns[name] for each in blocks]).tobytes()
    assert again.truth["truth_state"].tolist() == np.concatenate(states).tolist()
    assert again.truth["truth_known"].tolist() == [True, None, False, True] * 2


def test_numbers_are_never_null_and_texts_are_texts(tmp_path):
    path = tmp_path / "r.parquet"
    with recording_writer(path) as write:
        write(block(0, HEALTHY))
    kinds = {field.name: (field.type, field.nullable) for field in pa.parquet.read_schema(path)}
    assert kinds == {
        "time": (pa.timestamp("ns", tz="UTC"), False),
        "level_m": (pa.float64(), False),
        "pump1_flow_m3h": (pa.float64(), False),
        "truth_state": (pa.string(), True),
        "truth_known": (pa.bool_(), True),
    }


@pytest.mark.parametrize("size", [0, 1, 3, 400])
def test_numbers_in_a_row_are_the_text_that_arrow_makes_of_each(size):
    rng = np.random.default_rng(size)
    values = np.repeat(rng.choice([0.0, -0.0, 0.1 + 0.2, 1e-300, 50.0, np.nan, -np.inf], size), 3)
    texts, numbers = texts_of(values), pa.table({"value": pa.array(values)})
    assert pa.types.is_string(texts.type)
    assert csv_of(pa.table({"value": texts})) == csv_of(numbers)


def test_numbers_that_always_change_stay_numbers():
    assert texts_of(np.arange(10.0)).type == pa.float64()


def csv_of(table):
    file = io.BytesIO()
    pa.csv.write_csv(table, file, pa.csv.WriteOptions(include_header=False, quoting_style="none"))
    return file.getvalue()
