"""A pump that shows flow alone: whether it runs as it used to, and nothing more."""

import math

import numpy as np
import pytest

from wetwell.detector.blind_watch import REFERENCE_SEGMENTS, BlindWatch
from wetwell.detector.gate import Frame, PumpFrame
from wetwell.protocols.stamps import NS_PER_S

NAN = math.nan
WARM_UP_S = 30
LEARNT_S = WARM_UP_S + 25 * REFERENCE_SEGMENTS


def told(flows_m3h, *, running=None, period_s=1):
    """(second, evidence) of each change, for one flow a sample; `running` is the number of pumps on."""
    watch, changes = BlindWatch(), []
    for number, flow_m3h in enumerate(flows_m3h):
        on = 1 if running is None else running[number]
        pumps = tuple(PumpFrame(NAN, flow_m3h, NAN, NAN, is_on) for is_on in (True, on == 2))
        frame = Frame(number * period_s * NS_PER_S, float(period_s), NAN, NAN, pumps)
        if watch.update(frame, 0, (True, on == 2)):
            changes.append((number * period_s, watch.evidence()))
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
    assert watch.evidence() == {}
    _, watch = told(noisy(100.0, samples=LEARNT_S + 25))
    assert watch.evidence() == {"abnormal": False}


def test_two_running_pumps_have_a_reference_of_their_own():
    flows_m3h = noisy(100.0, 80.0, 100.0, 80.0, samples=600)
    changes, _ = told(flows_m3h, running=np.repeat([1, 2, 1, 2], 600))
    assert changes == []


def test_what_is_off_never_becomes_the_reference():
    changes, watch = told(noisy(100.0, 90.0, samples=4000))
    assert len(changes) == 1
    assert watch.evidence()["off"]["flow_m3h"] == pytest.approx(-0.1, abs=0.01)


@pytest.mark.parametrize("period_s", [10, 60])
def test_a_slow_feed_is_watched_too(period_s):
    ((second, _),) = told(noisy(100.0, 80.0, samples=60), period_s=period_s)[0]
    assert 60 * period_s < second <= 60 * period_s + 4 * max(period_s, 25)


def test_a_pump_that_shows_everything_is_left_alone():
    watch = BlindWatch()
    for second in range(2 * LEARNT_S):
        frame = Frame(second * NS_PER_S, 1.0, NAN, NAN, (PumpFrame(50.0, 100.0, 26.0, NAN, True),))
        assert not watch.update(frame, 0, (True,))
    assert watch.evidence() == {}
