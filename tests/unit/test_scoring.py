"""The figures that quality is told in, on cases that can be counted by hand."""

import numpy as np
import pytest
from scipy.stats import poisson

from wetwell.detector.scoring import (
    ScoredRun,
    detection_delay_s,
    false_alarms,
    macro_f1,
    poisson_interval,
    precision_and_recall,
    scored_runs,
)
from wetwell.protocols.messages import Verdict
from wetwell.protocols.recording import Recording
from wetwell.protocols.stamps import NS_PER_S

DAY_S = 86_400


@pytest.fixture(scope="module")
def recording():
    """Two days of two pumps: pump 1 is at fault in the second half of the second day."""
    seconds = np.arange(2 * DAY_S)
    states = np.where(seconds >= 1.5 * DAY_S, "pump_fault", "normal")
    return Recording(
        time_ns=seconds * NS_PER_S,
        columns={"pump2_running": np.zeros(seconds.size)},
        truth={"truth_pump1_state": states, "truth_pump2_state": np.full(seconds.size, "normal")},
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


def test_a_run_is_truly_what_most_of_its_samples_are(recording):
    runs = scored_runs(
        [
            verdict("learning", 0, 100),
            verdict("normal", START_S - 100, START_S + 90),
            verdict("pump_fault", START_S - 90, START_S + 100, early=True),
            verdict("pump_fault", START_S - 90, START_S + 100),
            verdict("unknown", START_S, START_S + 100, pump=2),
        ],
        recording,
    )
    assert runs == [
        ScoredRun(1, "normal", "normal"),
        ScoredRun(1, "pump_fault", "pump_fault"),
        ScoredRun(2, "unknown", "normal"),
    ]


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
    assert macro_f1(runs) == pytest.approx((0.75 + 2 / 3) / 2)
    assert macro_f1([]) == 0.0


def test_false_alarms_in_a_row_are_one_and_only_watched_healthy_time_counts(recording):
    alarms = false_alarms(
        [
            verdict("learning", 0, DAY_S // 2),
            verdict("normal", 0, DAY_S // 2),
            verdict("pump_fault", DAY_S, DAY_S + 1),
            verdict("system_fault", DAY_S + 2, DAY_S + 3),
            verdict("normal", DAY_S + 4, DAY_S + 5),
            verdict("pump_fault", DAY_S + 6, DAY_S + 7),
            verdict("pump_fault", START_S - 1, START_S),
            verdict("unknown", DAY_S, DAY_S, pump=2),
        ],
        recording,
    )
    assert alarms.count == 2
    assert alarms.station_days == pytest.approx((1.0 + 1.0) / 2)


def test_the_delay_runs_from_the_first_true_second_to_the_first_verdict_on_that_pump(recording):
    told = [
        verdict("pump_fault", 10, 20),
        verdict("pump_fault", START_S, START_S + 50, pump=2),
        verdict("system_fault", START_S, START_S + 60),
        verdict("pump_and_system_fault", START_S, START_S + 70),
        verdict("pump_fault", START_S, START_S + 80),
    ]
    assert detection_delay_s(told, recording, "pump_fault") == 70.0
    assert detection_delay_s(told[:3], recording, "pump_fault") is None
    assert detection_delay_s(told, recording, "system_fault") is None


@pytest.mark.parametrize("count", [0, 1, 7])
def test_the_poisson_interval_leaves_two_and_a_half_percent_on_either_side(count):
    low, high = poisson_interval(count, 10.0)
    assert poisson.cdf(count, high * 10.0) == pytest.approx(0.025)
    if count:
        assert poisson.sf(count - 1, low * 10.0) == pytest.approx(0.025)
    else:
        assert low == 0.0
