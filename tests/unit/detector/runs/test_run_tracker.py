"""Cutting a stream of samples into pump runs and their steady segments."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import brentq

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.runs.run_tracker import RunTracker
from wetwell.detector.stream.block import Block
from wetwell.detector.stream.loop import Stop
from wetwell.protocols.timestamps import NS_PER_S

NAN = math.nan


class Reading(NamedTuple):
    """Values of a pump in the order of a block."""

    frequency_hz: float
    flow_m3h: float
    head_m: float
    power_kw: float
    running: float


OFF = Reading(0.0, 0.0, 0.0, 0.0, 0.0)
ON = Reading(50.0, 200.0, 26.0, 15.0, 1.0)


def sample(second, *pumps, level_m=1.0):
    """A block of one sample."""
    values = [level_m, NAN, *(value for pump in pumps + (OFF,) * (3 - len(pumps)) for value in pump)]
    time_ns, seq, switched = np.array([second * NS_PER_S]), np.array([second]), np.zeros((1, 3), dtype=bool)
    return Block(time_ns, seq, np.array([values]), switched, np.zeros(1, dtype=bool), 3, False)


def ended(tracker, block):
    """Runs that a block ends."""
    return [run for stop in tracker.stops(block) if stop == Stop.RUNS_ENDED for run in tracker.ended_runs()]


@pytest.fixture
def tracker(alpha):
    return RunTracker(datasheet_of(alpha))


@pytest.fixture
def common_tracker(alpha):
    main = alpha.rising_main.model_copy(update={"layout": "common"})
    return RunTracker(datasheet_of(alpha.model_copy(update={"rising_main": main})))


def feed(tracker, seconds, *pumps, level_m=1.0):
    """Runs that end while these seconds pass."""
    return [run for second in seconds for run in ended(tracker, sample(second, *pumps, level_m=level_m))]


def test_a_run_goes_from_start_to_stop_and_is_steady_after_30_s(tracker):
    assert feed(tracker, range(10)) == []
    assert feed(tracker, range(10, 110), ON) == []
    (run,) = feed(tracker, [110])
    assert (run.pump, run.window_ns) == (0, (10 * NS_PER_S, 109 * NS_PER_S))
    assert run.time_s.tolist() == list(range(30, 100))
    assert len(run.segments) == 2
    assert run.missing == frozenset()
    assert tracker.finish() == []


def test_segments_are_means_of_25_residuals(tracker, alpha):
    flows = 200.0 + np.random.default_rng(0).normal(size=100)
    for second, flow in enumerate(flows):
        ended(tracker, sample(second, ON._replace(flow_m3h=float(flow))))
    (run,) = tracker.finish()
    c0, c1, c2 = alpha.pump[0].coefficients
    steady = flows[30:]
    pump_m = 26.0 - c0 - c1 * steady - c2 * steady**2
    system_m = 26.0 - 2.0 - 6.0e-4 * steady**2
    expected = [[series[a : a + 25].mean() for series in (pump_m, system_m)] for a in (0, 25)]
    np.testing.assert_allclose(run.segments.residual_m, expected, atol=1e-12)
    means = [steady[a : a + 25].mean() for a in (0, 25)]
    np.testing.assert_allclose(run.segments.flow_m3h, means)
    np.testing.assert_allclose(run.segments.total_m3h, means)
    np.testing.assert_array_equal(run.segments.level_m, [1.0, 1.0])
    np.testing.assert_array_equal(run.power_kw, np.full(70, 15.0))


def test_a_change_of_the_running_pumps_unsettles_all(tracker):
    feed(tracker, range(100), ON)
    feed(tracker, range(100, 200), ON, ON)
    (second,) = feed(tracker, range(200, 260), ON)
    (first,) = tracker.finish()
    assert second.time_s.tolist() == list(range(30, 100))
    assert first.time_s.tolist() == [*range(30, 100), *range(130, 200), *range(230, 260)]


@pytest.mark.parametrize(
    ("frequency_hz", "is_steady"),
    [(20.1, True), (25.0, True), (49.0, True), (62.4, True), (19.9, False), (62.6, False)],
)
def test_samples_at_any_speed_that_a_drive_goes_at_are_steady(tracker, frequency_hz, is_steady):
    feed(tracker, range(60), ON._replace(frequency_hz=frequency_hz))
    (run,) = tracker.finish()
    assert (len(run.time_s) == 30) is is_steady
    assert (run.speed_ratio == frequency_hz / 50.0).all()


def test_segments_at_another_speed_are_taken_to_nominal_and_know_the_datasheets_flow(tracker, alpha):
    c0, c1, c2 = alpha.pump[0].coefficients
    speed = 0.8
    flow_m3h = brentq(lambda q: c0 * speed**2 + c1 * speed * q + c2 * q * q - 2.0 - 6.0e-4 * q * q, 1.0, 400.0)
    duty = ON._replace(frequency_hz=50.0 * speed, flow_m3h=flow_m3h, head_m=2.0 + 6.0e-4 * flow_m3h**2)
    feed(tracker, range(60), duty)
    (run,) = tracker.finish()
    np.testing.assert_allclose(run.segments.residual_m, 0.0, atol=1e-9)
    np.testing.assert_allclose(run.segments.flow_m3h, flow_m3h / speed)
    np.testing.assert_allclose(run.segments.total_m3h, flow_m3h)
    np.testing.assert_allclose(run.segments.duty_m3h, flow_m3h / speed)
    np.testing.assert_allclose(run.segments.duty_total_m3h, flow_m3h)


@pytest.mark.parametrize(("step_hz", "is_settling"), [(0.9, False), (1.1, True)])
def test_a_step_of_the_speed_has_to_settle_for_ten_seconds(tracker, step_hz, is_settling):
    feed(tracker, range(60), ON)
    feed(tracker, range(60, 90), ON._replace(frequency_hz=50.0 - step_hz))
    (run,) = tracker.finish()
    left_out = range(60, 70) if is_settling else ()
    assert run.time_s.tolist() == [second for second in range(30, 90) if second not in left_out]


def test_a_speed_that_goes_on_drifting_settles_again_and_again(tracker):
    feed(tracker, range(60), ON)
    for second in range(60, 120):
        ended(tracker, sample(second, ON._replace(frequency_hz=50.0 - 0.5 * (second - 59))))
    (run,) = tracker.finish()
    assert run.time_s.max() < 63.0, "after two steps of half a hertz the third has moved on by more than 2 %"


def test_a_break_of_the_stream_ends_a_run_and_the_next_settles_anew(tracker):
    feed(tracker, range(100), ON)
    assert ended(tracker, sample(159, ON)) == []
    (run,) = ended(tracker, sample(220, ON))
    assert run.window_ns == (0, 159 * NS_PER_S)
    feed(tracker, range(221, 300), ON)
    (after,) = tracker.finish()
    assert after.window_ns == (220 * NS_PER_S, 299 * NS_PER_S)
    assert after.time_s[0] == 30.0


def test_a_long_run_is_told_in_parts_of_half_an_hour(tracker):
    parts = feed(tracker, range(4000), ON)
    parts += tracker.finish()
    assert [run.window_ns for run in parts] == [
        (0, 1799 * NS_PER_S),
        (1800 * NS_PER_S, 3599 * NS_PER_S),
        (3600 * NS_PER_S, 3999 * NS_PER_S),
    ]
    assert [len(run.time_s) for run in parts] == [1770, 1800, 400]


def test_a_common_header_carries_the_flow_of_all_running_pumps(common_tracker):
    feed(common_tracker, range(60), ON, ON._replace(flow_m3h=100.0), OFF._replace(flow_m3h=7.0))
    first, second = common_tracker.finish()
    assert set(first.total_flow_m3h) == set(second.total_flow_m3h) == {300.0}
    assert (set(first.flow_m3h), set(second.flow_m3h)) == ({200.0}, {100.0})


def test_a_common_header_is_not_judged_while_one_flow_is_unknown(common_tracker):
    feed(common_tracker, range(60), ON, ON._replace(flow_m3h=NAN))
    first, _ = common_tracker.finish()
    assert len(first.time_s) == 0


@pytest.mark.parametrize("name", ["frequency_hz", "flow_m3h", "head_m"])
def test_a_signal_that_never_came_is_named(tracker, name):
    feed(tracker, range(60), ON._replace(**{name: NAN}))
    (run,) = tracker.finish()
    assert run.missing == {name}
    assert len(run.time_s) == len(run.segments) == 0


def test_a_run_that_lacks_a_needed_signal_is_told_once_after_a_minute(tracker):
    blind, told = ON._replace(head_m=NAN), []
    for second in range(100):
        for stop in tracker.stops(sample(second, blind, ON)):
            if stop == Stop.RUN_BLIND:
                told += [(second, run.pump, run.missing) for run in tracker.newly_blind_runs()]
    assert told == [(60, 0, {"head_m"})]


def test_a_signal_that_came_at_times_is_not_missing(tracker):
    feed(tracker, range(40), ON, level_m=NAN)
    feed(tracker, range(40, 60), ON._replace(head_m=NAN), level_m=NAN)
    (run,) = tracker.finish()
    assert run.missing == {"level_m"}
    assert len(run.time_s) == 10


@pytest.mark.parametrize(
    ("on", "off"),
    [
        (Reading(50.0, NAN, NAN, NAN, NAN), Reading(0.0, NAN, NAN, NAN, NAN)),
        (Reading(NAN, 200.0, NAN, NAN, NAN), Reading(NAN, 1.0, NAN, NAN, NAN)),
    ],
)
def test_running_is_taken_from_frequency_or_flow_where_nobody_says_it(tracker, on, off):
    assert feed(tracker, range(10), off) == []
    feed(tracker, range(10, 60), on)
    feed(tracker, range(60, 65), Reading(NAN, NAN, NAN, NAN, NAN))
    (run,) = feed(tracker, [65], off)
    assert run.window_ns == (10 * NS_PER_S, 64 * NS_PER_S)


def test_the_flag_has_the_last_word_on_running(tracker):
    assert feed(tracker, range(60), ON._replace(running=0.0)) == []
    assert tracker.finish() == []


def test_the_last_segments_of_an_open_run_are_given_each_time_one_is_full(tracker):
    looks = {}
    tracker.set_learning(0, is_learning=False)
    for second in range(200):
        for stop in tracker.stops(sample(second, ON)):
            assert (stop, tracker.full_pumps()) == (Stop.SEGMENT_FULL, [0])
            filled = len(tracker.last_segments(0, 99).segments)
            looks[second] = filled, tracker.last_segments(0, 3)
    assert {second: filled for second, (filled, _) in looks.items()} == {54 + 25 * n: n + 1 for n in range(6)}
    assert looks[154][1].window_ns == (80 * NS_PER_S, 154 * NS_PER_S)
    assert [len(run.segments) for _, run in looks.values()] == [1, 2, 3, 3, 3, 3]
    with pytest.raises(ValueError, match="pump 1 has no open run"):
        tracker.last_segments(1, 1)


def test_a_closed_check_valve_says_nothing_of_the_main(tracker):
    feed(tracker, range(60), ON._replace(flow_m3h=0.0, head_m=1.0))
    (run,) = tracker.finish()
    np.testing.assert_allclose(run.segments.residual_m, [[1.0 - 36.0, 0.0]])


@pytest.mark.parametrize(("period_s", "samples"), [(1, 25), (2, 12), (5, 5), (10, 2), (30, 1), (60, 1)])
def test_a_slow_feed_has_shorter_segments(tracker, period_s, samples):
    for second in range(0, 1800, period_s):
        assert not ended(tracker, sample(second, ON))
    (run,) = ended(tracker, sample(1800))
    assert run.segments.samples == samples
    assert len(run.segments) == len(run.time_s) // samples
    assert run.time_s[0] == max(30, period_s)


def test_a_slow_feed_breaks_only_where_more_than_one_sample_is_lacking(tracker):
    counts = [len(ended(tracker, sample(second, ON))) for second in (-61, 0, 61, 122, 244, 305, 488)]
    assert counts[3:] == [0, 0, 0, 1], "the feed's period is 61 s; 122 s lack one sample, 183 s lack two"
