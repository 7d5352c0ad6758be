"""Round trip of recordings, whatever they hold."""

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.quantities import PUMP_QUANTITIES, STATION_QUANTITIES
from wetwell.protocols.recordings.recording import (
    SUFFIXES,
    Recording,
    read_recording,
    write_recording,
)
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S

NAMES = [*STATION_QUANTITIES, *(f"pump{i}_{quantity}" for i in (1, 2, 12) for quantity in PUMP_QUANTITIES)]
# In CSV a text that reads as a number is a number.
TEXTS = st.sampled_from(["normal", "pump_fault", "system_fault", "x", "-"])


@st.composite
def recordings(draw):
    """Times that repeat and fall; columns in any order with NaN, infinities and the smallest numbers."""
    rows = draw(st.integers(1, 6))
    unit_ns = draw(st.sampled_from([1, 1000, 1_000_000, NS_PER_S]))
    far = MAX_STAMP_NS // unit_ns
    near = st.integers(1_700_000_000 * NS_PER_S // unit_ns, 1_700_000_003 * NS_PER_S // unit_ns)
    times = draw(st.lists(near | st.integers(-far, far), min_size=rows, max_size=rows))
    floats = st.floats() | st.just(np.nan)
    names = draw(st.lists(st.sampled_from(NAMES), min_size=1, unique=True))
    if not any(name.startswith("pump") for name in names):
        names.append("pump1_flow_m3h")
    columns = {name: np.array(draw(st.lists(floats, min_size=rows, max_size=rows)), dtype=float) for name in names}
    truth = {
        "truth_state": np.array(draw(st.lists(TEXTS, min_size=rows, max_size=rows)), dtype="U12"),
        "truth_factor": np.array(draw(st.lists(st.floats(-9, 9), min_size=rows, max_size=rows)), dtype=float),
    }
    return Recording(time_ns=unit_ns * np.array(times, dtype=np.int64), columns=columns, truth=truth)


@settings(max_examples=80)
@given(recordings(), st.sampled_from(SUFFIXES))
def test_round_trip_and_same_bytes(recording, suffix):
    with tempfile.TemporaryDirectory() as folder:
        first, second = Path(folder, f"first{suffix}"), Path(folder, f"second{suffix}")
        write_recording(recording, first)
        again = read_recording(first)
        write_recording(again, second)
        third = read_recording(second)
        assert sorted(path.name for path in Path(folder).iterdir()) == [first.name, second.name]
    for copy in (again, third):
        assert copy.time_ns.tolist() == recording.time_ns.tolist()
        assert list(copy.columns) == list(recording.columns)
        for name, column in recording.columns.items():
            np.testing.assert_array_equal(copy.columns[name], column)
        assert sorted(copy.truth) == sorted(recording.truth)
        np.testing.assert_array_equal(copy.truth["truth_factor"], recording.truth["truth_factor"])
        assert copy.truth["truth_state"].tolist() == recording.truth["truth_state"].tolist()
        assert copy.pumps == recording.pumps
        assert copy.ignored == ()


@settings(max_examples=40)
@given(recordings())
def test_samples_survive_the_wire(recording):
    """NaN and infinities are no value; all else comes back as it was."""
    for row, sample in enumerate(recording.samples("alpha")):
        again = Sample.decode(sample.encode())
        assert again.time == recording.time_ns[row]
        assert again.seq == row
        level_m = recording.column("level_m")[row]
        assert again.level_m == (level_m if np.isfinite(level_m) else None)
        for pump, reading in enumerate(again.pumps, start=1):
            flow_m3h = recording.column(f"pump{pump}_flow_m3h")[row]
            assert reading.flow_m3h == (flow_m3h if np.isfinite(flow_m3h) else None)
