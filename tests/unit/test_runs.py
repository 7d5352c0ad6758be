"""Cutting a stream of frames into pump runs and their steady segments."""

import math

import numpy as np
import pytest

from wetwell.detector.gate import Frame, PumpFrame
from wetwell.detector.nominal import nominal_of
from wetwell.detector.runs import RunTracker
from wetwell.protocols.stamps import NS_PER_S

NAN = math.nan
OFF = PumpFrame(0.0, 0.0, 0.0, 0.0, False)
ON = PumpFrame(50.0, 200.0, 26.0, 15.0, True)


def frame(second, *pumps, gap_s=1.0, level_m=1.0):
    return Frame(second * NS_PER_S, gap_s, level_m, pumps + (OFF,) * (3 - len(pumps)))


@pytest.fixture
def tracker(alpha):
    return RunTracker(nominal_of(alpha))


@pytest.fixture
def common_tracker(alpha):
    main = alpha.rising_main.model_copy(update={"layout": "common"})
    return RunTracker(nominal_of(alpha.model_copy(update={"rising_main": main})))


def feed(tracker, seconds, *pumps, level_m=1.0):
    """Runs that end while these seconds pass."""
    return [run for second in seconds for run in tracker.update(frame(second, *pumps, level_m=level_m))]


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
        tracker.update(frame(second, ON._replace(flow_m3h=float(flow))))
    (run,) = tracker.finish()
    c0, c1, c2 = alpha.pump[0].coefficients
    steady = flows[30:]
    pump_m = 26.0 - c0 - c1 * steady - c2 * steady**2
    system_m = 26.0 - 2.0 - 6.0e-4 * steady**2
    expected = [[series[a : a + 25].mean() for series in (pump_m, system_m)] for a in (0, 25)]
    np.testing.assert_allclose(run.segments, expected, atol=1e-12)


def test_a_change_of_the_running_pumps_unsettles_all(tracker):
    feed(tracker, range(100), ON)
    feed(tracker, range(100, 200), ON, ON)
    (second,) = feed(tracker, range(200, 260), ON)
    (first,) = tracker.finish()
    assert second.time_s.tolist() == list(range(30, 100))
    assert first.time_s.tolist() == [*range(30, 100), *range(130, 200), *range(230, 260)]


@pytest.mark.parametrize(("frequency_hz", "is_steady"), [(49.1, True), (50.9, True), (48.9, False), (51.1, False)])
def test_only_samples_near_nominal_frequency_are_steady(tracker, frequency_hz, is_steady):
    feed(tracker, range(60), ON._replace(frequency_hz=frequency_hz))
    (run,) = tracker.finish()
    assert (len(run.time_s) == 30) is is_steady


def test_a_break_of_the_stream_ends_a_run_and_the_next_settles_anew(tracker):
    feed(tracker, range(100), ON)
    assert tracker.update(frame(160, ON, gap_s=60.0)) == []
    (run,) = tracker.update(frame(221, ON, gap_s=61.0))
    assert run.window_ns == (0, 160 * NS_PER_S)
    feed(tracker, range(222, 300), ON)
    (after,) = tracker.finish()
    assert after.window_ns == (221 * NS_PER_S, 299 * NS_PER_S)
    assert after.time_s[0] == 30.0


def test_a_long_run_is_told_in_parts_of_half_an_hour(tracker):
    ended = feed(tracker, range(4000), ON)
    ended += tracker.finish()
    assert [run.window_ns for run in ended] == [
        (0, 1799 * NS_PER_S),
        (1800 * NS_PER_S, 3599 * NS_PER_S),
        (3600 * NS_PER_S, 3999 * NS_PER_S),
    ]
    assert [len(run.time_s) for run in ended] == [1770, 1800, 400]


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
        tracker.update(frame(second, blind, ON))
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
        (PumpFrame(50.0, NAN, NAN, NAN, None), PumpFrame(0.0, NAN, NAN, NAN, None)),
        (PumpFrame(NAN, 200.0, NAN, NAN, None), PumpFrame(NAN, 1.0, NAN, NAN, None)),
    ],
)
def test_running_is_taken_from_frequency_or_flow_where_nobody_says_it(tracker, on, off):
    assert feed(tracker, range(10), off) == []
    feed(tracker, range(10, 60), on)
    feed(tracker, range(60, 65), PumpFrame(NAN, NAN, NAN, NAN, None))
    (run,) = feed(tracker, [65], off)
    assert run.window_ns == (10 * NS_PER_S, 64 * NS_PER_S)


def test_the_flag_has_the_last_word_on_running(tracker):
    assert feed(tracker, range(60), ON._replace(running=False)) == []
    assert tracker.finish() == []


def test_the_last_segments_of_an_open_run_are_given_once_each_time_one_is_full(tracker):
    looks = {}
    for second in range(200):
        tracker.update(frame(second, ON))
        run = tracker.last_segments(0, 3)
        if run is not None:
            looks[second] = run
    assert list(looks) == [104, 129, 154, 179]
    assert looks[129].window_ns == (55 * NS_PER_S, 129 * NS_PER_S)
    assert all(len(run.segments) == 3 and len(run.time_s) == 75 for run in looks.values())
    assert tracker.steady_samples() == [(0, 200.0, 26.0, 1.0, 200.0)]
