"""How recordings lie in Parquet."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

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
