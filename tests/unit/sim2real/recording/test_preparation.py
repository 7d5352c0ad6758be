"""Preparation of field data: what it changes, finds and counts."""

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S, from_iso
from wetwell.sim2real.recording.preparation import Preparation, prepare

START_NS = from_iso("2024-11-20T12:00:00Z")


def recording(seconds, level_m=None):
    seconds = np.array(seconds)
    level_m = np.arange(seconds.size, dtype=float) if level_m is None else np.array(level_m, dtype=float)
    flow_m3h = np.full(seconds.size, 10.0)
    return Recording(
        time_ns=START_NS + seconds * NS_PER_S,
        columns={"level_m": level_m, "pump1_flow_m3h": flow_m3h},
        truth={"truth_state": np.array(["normal"] * seconds.size)},
    )


def test_rows_are_sorted_doubles_dropped_and_gaps_listed():
    prepared, report = prepare(recording([0, 2, 1, 1, 30, 31]), Preparation())
    assert ((prepared.time_ns - START_NS) // NS_PER_S).tolist() == [0, 1, 2, 30, 31]
    assert prepared.columns["level_m"].tolist() == [0.0, 2.0, 1.0, 4.0, 5.0]
    assert prepared.truth["truth_state"].size == 5
    assert (report.rows, report.out_of_order, report.doubled) == (5, 1, 1)
    assert [(gap.start_ns, gap.length_s) for gap in report.gaps] == [(START_NS + 2 * NS_PER_S, 28.0)]


@pytest.mark.parametrize(("step_s", "max_gap_s"), [(1, 10.0), (5, 15.0), (60, 180.0), (900, 2700.0)])
def test_without_a_longest_gap_it_follows_the_rate(step_s, max_gap_s):
    seconds = step_s * np.array([0, 1, 2, 3, 4, 5, 16, 17, 18])
    _, report = prepare(recording(seconds), Preparation())
    assert report.max_gap_s == max_gap_s
    assert [gap.length_s for gap in report.gaps] == [11.0 * step_s]
    assert prepare(recording(seconds), Preparation(max_gap_s=0.5))[1].max_gap_s == 0.5


def test_an_offset_acts_within_its_span_only_and_is_counted():
    raw = recording(range(10))
    span = {"column": "level_m", "value": 0.8, "start": "2024-11-20T12:00:02Z", "end": "2024-11-20T12:00:04Z"}
    prepared, report = prepare(raw, Preparation(offset=[span]))
    added_m = prepared.columns["level_m"] - raw.columns["level_m"]
    assert added_m == pytest.approx([0, 0, 0.8, 0.8, 0.8, 0, 0, 0, 0, 0])
    assert report.shifted == {"level_m": 3}
    assert raw.columns["level_m"].tolist() == list(range(10)), "the input must not change"


def test_scale_converts_units_before_offsets():
    span = {"column": "level_m", "value": 1.0, "start": "2024-11-20T11:00:00Z", "end": "2024-11-20T13:00:00Z"}
    plan = Preparation(scale=[{"column": "level_m", "factor": 0.01}], offset=[span])
    prepared, _ = prepare(recording(range(3), [100.0, 200.0, np.nan]), plan)
    assert prepared.columns["level_m"][:2].tolist() == [2.0, 3.0]
    assert np.isnan(prepared.columns["level_m"][2])


def test_an_unknown_column_is_named():
    with pytest.raises(ValueError, match="column 'levle_m' is not in the recording, there are level_m"):
        prepare(recording(range(3)), Preparation(scale=[{"column": "levle_m", "factor": 2.0}]))
