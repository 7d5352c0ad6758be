"""The figures of a backtest from outcomes that can be counted by hand."""

import json

import pytest
from scipy.stats import poisson

from wetwell.detector.evaluation.backtest import Outcome, summary
from wetwell.detector.evaluation.detections import Detection, FalseAlarms
from wetwell.detector.evaluation.scores import ScoredRun


def outcome(runs, alarms=0, found=()):
    return Outcome(
        runs=tuple(runs), alarms=FalseAlarms(alarms, 2.0), detections=tuple(found), station_days=2.5, judging_s=1.0
    )


def detection(delay_s):
    runs = None if delay_s is None else 3
    return Detection(state="pump_fault", delay_s=delay_s, steady_delay_s=delay_s, severity=None, runs=runs)


GOOD = [ScoredRun(1, "normal", "normal")] * 8 + [
    ScoredRun(1, "pump_fault", "pump_fault", "blockage", 0.05),
    ScoredRun(1, "pump_fault", "pump_fault", "blockage", 0.1),
]
BAD = [ScoredRun(1, "normal", "normal")] * 7 + [
    ScoredRun(1, "system_fault", "normal"),
    ScoredRun(1, "system_fault", "pump_fault", "blockage", 0.0),
    ScoredRun(1, "unknown", "pump_fault", "blockage", 0.6),
]


@pytest.fixture(scope="module")
def figures():
    return summary([outcome(GOOD, 0, [detection(100.0)]), outcome(BAD, 1, [detection(None), detection(300.0)])])


def test_scores_over_all_runs_and_by_recording(figures):
    normal, pump = figures["states"]["normal"], figures["states"]["pump_fault"]
    assert (normal["precision"], normal["recall"]) == (1.0, 15 / 16)
    assert (pump["precision"], pump["recall"], pump["runs"]) == (1.0, 0.5, 4)
    assert set(figures["states"]) == {"normal", "pump_fault"}
    assert figures["macro_f1"] == pytest.approx((30 / 31 + 2 / 3) / 2)
    by_recording = figures["macro_f1_by_recording"]
    assert by_recording["least"] == pytest.approx(14 / 15 / 2)
    assert by_recording["mean"] == pytest.approx((1.0 + 14 / 15 / 2) / 2)
    assert figures["abstention"] == {"unknown": 1 / 20, "learning": 0.0}


def test_false_alarms_and_run_lengths_have_exact_intervals(figures):
    alarms, lengths = figures["false_alarms"], figures["run_length"]
    assert (alarms["count"], alarms["station_days"], alarms["per_station_day"]) == (1, 4.0, 0.25)
    low, high = alarms["interval_95"]
    assert poisson.cdf(1, high * 4.0) == pytest.approx(0.025)
    assert poisson.sf(0, low * 4.0) == pytest.approx(0.025)
    assert (lengths["healthy"], lengths["faulty_median"]) == (16.0, 3.0)
    assert lengths["healthy_interval_95"] == pytest.approx([16 / (high * 4.0), 16 / (low * 4.0)])


def test_a_missed_fault_is_an_infinite_delay_and_null_in_json(figures):
    found = figures["detection"]["pump_fault"]
    assert (found["faults"], found["missed"]) == (3, 1)
    assert found["delay_s"] == {"median": 300.0, "quantile_95": None}
    json.dumps(figures, allow_nan=False)


def test_recall_by_kind_and_by_severity_counts_each_run_once(figures):
    assert figures["kinds"] == [{"kind": "blockage", "runs": 4, "recall": 0.5, "noticed": 0.75}]
    bins = [(row["from"], row["to"], row["runs"], row["recall"]) for row in figures["severities"]]
    assert bins == [(0.0, 0.1, 3, 2 / 3), (0.5, 0.75, 1, 0.0)]


def test_nothing_to_score_gives_nulls():
    figures = summary([outcome([])])
    assert figures["macro_f1"] is None
    assert figures["false_alarms"]["interval_95"] == pytest.approx([0.0, 1.844], abs=1e-3)
    json.dumps(figures, allow_nan=False)
