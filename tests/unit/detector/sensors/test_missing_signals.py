"""A pump that shows flow alone: whether it runs as it used to, and nothing more."""

import math

import numpy as np
import pytest

from wetwell.detector.curves import datasheet
from wetwell.detector.sensors.missing_signals import REFERENCE_SEGMENTS, MissingSignals
from wetwell.detector.stream.missing_signals import gather_segments, new_missing_signals
from wetwell.detector.stream.run_state import PUMP_STATE
from wetwell.protocols.timestamps import NS_PER_S

NAN = math.nan
WARM_UP_S = 30
STILL = np.zeros(2, dtype=bool)
TABLE = np.zeros(2, dtype=datasheet.TABLE)
"""Two pumps on one main."""
HEAD_LOST = np.zeros(2, dtype=np.int64)
"""Both pumps had a head sensor."""
LEARNT_S = WARM_UP_S + 25 * REFERENCE_SEGMENTS


def frame_of(*pumps):
    """Values of a sample without level and inflow."""
    return np.array([NAN, NAN, *(value for pump in pumps for value in pump)])


def told(flows_m3h, *, running=None, period_s=1):
    """(second, evidence) of each change, for one flow a sample; `running` is the number of pumps on."""
    watch, gathered, pumps, changes = MissingSignals(), new_missing_signals(2), np.zeros(2, dtype=PUMP_STATE), []
    pumps["is_learning"] = 1
    for number, flow_m3h in enumerate(flows_m3h):
        on = 1 if running is None else running[number]
        pumps["is_running"] = (1, on == 2)
        frame = frame_of((NAN, flow_m3h, NAN, NAN, 1.0), (NAN, flow_m3h, NAN, NAN, float(on == 2)))
        gather_segments(
            TABLE, gathered, number * period_s * NS_PER_S, float(period_s), frame, STILL, HEAD_LOST, pumps
        )
        if gathered["is_full"][0] and watch.update(gathered[0]):
            changes.append((number * period_s, watch.evidence(on)))
    return changes, watch


def noisy(*levels_m3h, samples, seed=0):
    rng = np.random.default_rng(seed)
    return np.concatenate([level * (1.0 + 0.01 * rng.normal(size=samples)) for level in levels_m3h])


@pytest.mark.parametrize("share", [-0.3, -0.05, 0.05])
def test_a_flow_that_moves_is_told_within_three_segments_and_so_is_its_return(share):
    changes, _ = told(noisy(100.0, 100.0 * (1.0 + share), 100.0, samples=600))
    (begin_s, begun), (end_s, ended) = changes
    assert 600 < begin_s <= 600 + 3 * 25
    assert 1200 < end_s <= 1200 + 3 * 25
    assert begun["abnormal"] is True
    assert "flow_m3h is" in begun["advice"]
    assert ended == {"abnormal": False}


def test_a_steady_flow_is_never_abnormal():
    assert all(told(noisy(100.0, samples=5000, seed=seed))[0] == [] for seed in range(10))


def test_less_than_two_percent_is_passed_over():
    assert told(noisy(100.0, 98.5, samples=600))[0] == []


def test_nothing_is_said_before_five_minutes_of_running():
    _, watch = told(noisy(100.0, samples=LEARNT_S - 1))
    assert watch.evidence(1) == {}
    _, watch = told(noisy(100.0, samples=LEARNT_S + 25))
    assert watch.evidence(1) == {"abnormal": False}


def test_two_running_pumps_have_a_reference_of_their_own():
    flows_m3h = noisy(100.0, 80.0, 100.0, 80.0, samples=600)
    changes, _ = told(flows_m3h, running=np.repeat([1, 2, 1, 2], 600))
    assert changes == []


def test_what_is_off_never_becomes_the_reference():
    changes, watch = told(noisy(100.0, 90.0, samples=4000))
    assert len(changes) == 1
    assert watch.evidence(1)["off"]["flow_m3h"] == pytest.approx(-0.1, abs=0.01)


@pytest.mark.parametrize("period_s", [10, 60])
def test_a_slow_feed_is_watched_too(period_s):
    ((second, _),) = told(noisy(100.0, 80.0, samples=60), period_s=period_s)[0]
    assert 60 * period_s < second <= 60 * period_s + 4 * max(period_s, 25)


@pytest.mark.parametrize("name", ["is_running", "is_learning"])
def test_a_pump_that_stands_or_that_can_be_judged_is_left_alone(name):
    gathered, pumps = new_missing_signals(1), np.ones(1, dtype=PUMP_STATE)
    pumps[name] = 0
    values = frame_of((NAN, 100.0, NAN, NAN, 1.0))
    assert not any(
        gather_segments(TABLE, gathered, second * NS_PER_S, 1.0, values, STILL, HEAD_LOST, pumps)
        for second in range(LEARNT_S)
    )


def test_a_pump_that_shows_everything_is_left_alone():
    gathered, pumps = new_missing_signals(1), np.ones(1, dtype=PUMP_STATE)
    values = frame_of((50.0, 100.0, 26.0, NAN, 1.0))
    assert not any(
        gather_segments(TABLE, gathered, second * NS_PER_S, 1.0, values, STILL, HEAD_LOST, pumps)
        for second in range(LEARNT_S)
    )


def test_a_pump_that_is_judged_without_a_head_sensor_is_left_alone():
    gathered, pumps = new_missing_signals(1), np.ones(1, dtype=PUMP_STATE)
    values, lacks_head = frame_of((50.0, 100.0, NAN, NAN, 1.0)), np.ones(1, dtype=np.int64)
    seconds_ns = np.arange(LEARNT_S) * NS_PER_S
    assert not any(gather_segments(TABLE, gathered, now, 1.0, values, STILL, lacks_head, pumps) for now in seconds_ns)
    assert any(gather_segments(TABLE, gathered, now, 1.0, values, STILL, HEAD_LOST, pumps) for now in seconds_ns)


def test_a_clock_that_is_set_begins_a_segment_anew():
    gathered, pumps = new_missing_signals(1), np.ones(1, dtype=PUMP_STATE)
    values = frame_of((NAN, 100.0, NAN, NAN, 1.0))
    begun = [
        gather_segments(TABLE, gathered, (10_000 + second) * NS_PER_S, 1.0, values, STILL, HEAD_LOST, pumps)
        for second in range(50)
    ]
    set_back = [
        gather_segments(
            TABLE, gathered, second * NS_PER_S, 1.0 if second else math.inf, values, STILL, HEAD_LOST, pumps
        )
        for second in range(55)
    ]
    assert sum(begun) == 0
    assert np.flatnonzero(set_back).tolist() == [54], "30 s to settle, then 25 samples"
