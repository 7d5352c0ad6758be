"""The figures that quality is told in, on cases that can be counted by hand."""

import numpy as np
import pytest

from wetwell.detector.evaluation.scores import (
    CLASSES,
    ScoredRun,
    confusion,
    f1,
    in_order_of_time,
    macro_f1,
    precision_and_recall,
    scored_runs,
    without_truth,
)
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S

DAY_S = 86_400


@pytest.fixture(scope="module")
def recording():
    """Two days of two pumps: pump 1 is at fault in the second half of the second day."""
    seconds = np.arange(2 * DAY_S)
    states = np.where(seconds >= 1.5 * DAY_S, "pump_fault", "normal")
    return Recording(
        time_ns=seconds * NS_PER_S,
        columns={"pump2_running": np.zeros(seconds.size)},
        truth={
            "truth_pump1_state": states,
            "truth_pump2_state": np.full(seconds.size, "normal"),
            "truth_fault": np.where(seconds >= 1.5 * DAY_S, "blockage", ""),
            "truth_pump1_severity": np.where(seconds >= 1.5 * DAY_S, 0.5, 0.0),
        },
    )


def verdict(state, first_s, last_s, *, pump=1, early=False):
    return Verdict(
        time=last_s * NS_PER_S,
        station="alpha",
        pump=pump,
        state=state,
        probability={state: 1.0},
        evidence={"early": True} if early else {},
        window=(first_s * NS_PER_S, last_s * NS_PER_S),
    )


START_S = DAY_S * 3 // 2


def told(verdicts, recording, learning_s=0.0):
    return [(run.pump, run.told, run.truth) for run in scored_runs(verdicts, recording, learning_s)]


def test_a_run_is_truly_what_most_of_its_samples_are(recording):
    verdicts = [
        verdict("learning", 0, 100),
        verdict("normal", START_S - 100, START_S + 90),
        verdict("pump_fault", START_S - 90, START_S + 100, early=True),
        verdict("pump_fault", START_S - 90, START_S + 100),
        verdict("unknown", START_S, START_S + 100, pump=2),
    ]
    assert told(verdicts, recording) == [
        (1, "learning", "normal"),
        (1, "normal", "normal"),
        (1, "pump_fault", "pump_fault"),
        (2, "unknown", "normal"),
    ]


def test_what_ends_while_learning_is_allowed_is_not_scored_and_a_run_counts_once(recording):
    verdicts = [
        verdict("pump_fault", 10, 3600),
        verdict("unknown", 3000, 3660),
        verdict("normal", 3000, 4000),
        verdict("learning", 5000, 6000),
    ]
    assert told(verdicts, recording, learning_s=3600.0) == [(1, "normal", "normal"), (1, "learning", "normal")]


def test_kind_severity_and_probability_go_with_the_run(recording):
    faulty = verdict("pump_fault", START_S, START_S + 99).model_copy(
        update={"probability": {"normal": 0.25, "pump_fault": 0.5, "system_fault": 0.25}}
    )
    healthy = verdict("unknown", START_S, START_S + 99, pump=2)
    first, second = scored_runs([faulty, healthy], recording)
    assert (first.kind, first.severity, first.fault_probability) == ("blockage", 0.5, 0.75)
    assert second.kind == ""
    assert np.isnan([second.severity, second.fault_probability]).all()


def test_rows_out_of_order_are_sorted_with_their_truth(recording):
    order = np.random.default_rng(0).permutation(len(recording))
    mixed = Recording(
        time_ns=recording.time_ns[order],
        columns={name: values[order] for name, values in recording.columns.items()},
        truth={name: values[order] for name, values in recording.truth.items()},
    )
    ordered = in_order_of_time(mixed)
    assert np.array_equal(ordered.time_ns, recording.time_ns)
    assert np.array_equal(ordered.truth["truth_pump1_state"], recording.truth["truth_pump1_state"])


def test_no_truth_is_left_for_a_detector(recording):
    bare = without_truth(recording)
    assert not bare.truth
    assert bare.columns.keys() == recording.columns.keys()


def test_the_confusion_counts_every_run_once():
    runs = [ScoredRun(1, "normal", "normal")] * 3 + [
        ScoredRun(1, "unknown", "system_fault"),
        ScoredRun(1, "learning", "sensor_fault"),
        ScoredRun(2, "pump_fault", "pump_and_system_fault"),
    ]
    table = confusion(runs)
    assert table.shape == (5, 7)
    assert table.sum() == 6
    rows = {state: table[row].tolist() for row, state in enumerate(CLASSES)}
    assert rows == {
        "normal": [3, 0, 0, 0, 0, 0, 0],
        "pump_fault": [0, 0, 0, 0, 0, 0, 0],
        "system_fault": [0, 0, 0, 0, 0, 1, 0],
        "pump_and_system_fault": [0, 1, 0, 0, 0, 0, 0],
        "sensor_fault": [0, 0, 0, 0, 0, 0, 1],
    }


def test_precision_recall_and_f1_by_hand():
    runs = (
        [ScoredRun(1, "normal", "normal")] * 6
        + [ScoredRun(1, "unknown", "normal")] * 2
        + [ScoredRun(1, "normal", "system_fault")] * 2
        + [ScoredRun(1, "system_fault", "system_fault")] * 2
    )
    assert precision_and_recall(runs, "normal") == (6 / 8, 6 / 8)
    assert precision_and_recall(runs, "system_fault") == (1.0, 0.5)
    assert precision_and_recall(runs, "pump_fault") == (0.0, 0.0)
    assert f1(runs, "system_fault") == pytest.approx(2 / 3)
    assert macro_f1(runs) == pytest.approx((0.75 + 2 / 3) / 2)
    assert macro_f1([]) == 0.0
