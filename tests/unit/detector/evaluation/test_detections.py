"""False alarms and delays, on cases that can be counted by hand."""

import numpy as np
import pytest
from scipy.stats import poisson

from wetwell.detector.evaluation.detections import detections, false_alarms, poisson_interval
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S

DAY_S = 86_400
START_S = DAY_S * 3 // 2


def recording_of(pump_1, pump_2=None, running=None):
    """One or two days at 1 Hz; pumps run all the time unless told."""
    seconds = np.arange(len(pump_1))
    on = np.ones(seconds.size) if running is None else running
    truth = {"truth_pump1_state": pump_1, "truth_pump2_state": pump_1 if pump_2 is None else pump_2}
    return Recording(
        time_ns=seconds * NS_PER_S,
        columns={"pump1_running": on, "pump2_running": on},
        truth=truth | {"truth_pump1_severity": seconds / seconds.size, "truth_severity": seconds / seconds.size},
    )


@pytest.fixture(scope="module")
def blocked():
    """Two days of two pumps: pump 1 is at fault in the second half of the second day."""
    states = np.where(np.arange(2 * DAY_S) >= START_S, "pump_fault", "normal")
    return recording_of(states, np.full(states.size, "normal"))


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


def test_false_alarms_in_a_row_are_one_and_only_watched_healthy_time_counts(blocked):
    alarms = false_alarms(
        [
            verdict("learning", 0, DAY_S // 2),
            verdict("normal", 0, DAY_S // 2),
            verdict("pump_fault", DAY_S, DAY_S + 1),
            verdict("sensor_fault", DAY_S + 2, DAY_S + 3),
            verdict("normal", DAY_S + 4, DAY_S + 5),
            verdict("pump_fault", DAY_S + 6, DAY_S + 7),
            verdict("pump_fault", START_S - 1, START_S),
            verdict("unknown", DAY_S, DAY_S, pump=2),
        ],
        blocked,
    )
    assert alarms.count == 2
    assert alarms.station_days == pytest.approx((1.0 + 1.0) / 2)


def test_a_pump_fault_is_told_by_a_verdict_on_that_pump_that_reaches_into_it(blocked):
    told = [
        verdict("pump_fault", 10, 20),
        verdict("pump_fault", START_S, START_S + 50, pump=2),
        verdict("system_fault", START_S, START_S + 60),
        verdict("pump_fault", START_S + 61, START_S + 65, early=True),
        verdict("pump_and_system_fault", START_S + 61, START_S + 70),
    ]
    (found,) = detections(told, blocked)
    assert (found.state, found.delay_s, found.runs) == ("pump_fault", 65.0, 2)
    assert found.steady_delay_s == 65.0, "the pump had long been steady"
    assert found.severity == pytest.approx((START_S + 65) / (2 * DAY_S))
    (missed,) = detections(told[:3], blocked)
    assert (missed.delay_s, missed.steady_delay_s, missed.severity, missed.runs) == (None, None, None, None)


def test_the_steady_delay_begins_half_a_minute_after_the_next_start():
    states = np.where(np.arange(DAY_S) >= 30_000, "pump_fault", "normal")
    running = (np.arange(DAY_S) >= 30_100).astype(float)
    (found,) = detections(
        [verdict("pump_fault", 30_100, 30_200)], recording_of(states, np.full(DAY_S, "normal"), running)
    )
    assert found.delay_s == 200.0
    assert found.steady_delay_s == 71.0, "off until 30,099 s, steady from 30,129 s"


def test_a_system_fault_is_one_for_all_pumps_and_counts_after_learning_only():
    seconds = np.arange(DAY_S)
    early = (seconds >= 1000) & (seconds < 2000)
    late = ((seconds >= 30_000) & (seconds < 31_000)) | ((seconds >= 33_000) & (seconds < 34_000))
    states = np.where(early | late, "system_fault", "normal")
    (found,) = detections([verdict("system_fault", 32_000, 33_500, pump=2)], recording_of(states))
    assert (found.state, found.delay_s) == ("system_fault", 3500.0)


def test_both_at_once_are_two_faults():
    states = np.where(np.arange(DAY_S) >= 30_000, "pump_and_system_fault", "normal")
    normal = np.full(DAY_S, "normal")
    found = detections([verdict("system_fault", 30_000, 30_100)], recording_of(states, normal))
    assert [(one.state, one.delay_s) for one in found] == [("pump_fault", None), ("system_fault", 100.0)]


@pytest.mark.parametrize("count", [0, 1, 7])
def test_the_poisson_interval_leaves_two_and_a_half_percent_on_either_side(count):
    low, high = poisson_interval(count, 10.0)
    assert poisson.cdf(count, high * 10.0) == pytest.approx(0.025)
    if count:
        assert poisson.sf(count - 1, low * 10.0) == pytest.approx(0.025)
    else:
        assert low == 0.0
