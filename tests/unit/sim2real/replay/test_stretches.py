"""Straight stretches of the level before a start or a stop, of values that lie apart."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording
from wetwell.services.stations import find_scenario
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.stretches import Stretches, switches_of
from wetwell.simulator.simulation import Simulation

SECONDS = 43_200


def lines_of(level_m, counted, second, **more):
    counted = np.array([counted])
    every = np.ones(counted.shape, dtype=bool)
    return Stretches(second=np.array([second]), counted=counted, is_counted=every, level_m=level_m, least=2, **more)


@pytest.mark.parametrize("counted", [(0, 60), (0, 60, 120, 180), tuple(range(150, 180))])
def test_the_leverage_is_that_of_least_squares(counted):
    """Against the covariance of numpy's fit of a line, with noise of one."""
    second = 190
    design = np.vander(np.array(counted) - second, 2)
    (_, _), (_, variance) = np.linalg.inv(design.T @ design)
    assert lines_of(np.zeros(200), counted, second).leverage == pytest.approx(variance)


def test_a_mean_is_of_the_middle_of_its_interval():
    level_m = 1.0 + 0.001 * np.arange(200.0)
    late = lines_of(np.r_[0.0, level_m[:-1]], (60, 120, 180), 190, late_s=1.0)
    level, slope_m_s = late.lines()
    assert (level, slope_m_s) == (pytest.approx(level_m[190]), pytest.approx(0.001))


@pytest.fixture(scope="module")
def each_second(alpha):
    return Simulation(alpha, find_scenario("nominal"), 8).advance(SECONDS, truth=False)


def rows(recording, every, value):
    if value == "instant":
        place = np.arange(3, len(recording), every)
        columns = {name: values[place] for name, values in recording.columns.items()}
        return Recording(time_ns=recording.time_ns[place], columns=columns, value=value)
    count = len(recording) // every
    columns = {n: v[: count * every].reshape(count, every).mean(axis=1) for n, v in recording.columns.items()}
    return Recording(time_ns=recording.time_ns[every - 1 :: every][:count], columns=columns, value=value)


def of(recording, station):
    traces = traces_of(recording, station)
    return switches_of(traces, station, regimes_of(traces, station), traces.level_m)


def nearest(told, true, begin_s):
    """Which of the true switches each of those is that rows tell, which begin so many seconds later."""
    return [int(np.argmin(np.abs(true.stretches.second - second - begin_s))) for second in told.stretches.second]


@pytest.mark.parametrize(("every", "value"), [(10, "instant"), (60, "instant"), (10, "mean"), (60, "mean")])
def test_rows_tell_the_level_of_a_switch_as_each_second_does(alpha, each_second, every, value):
    """They are off by what they leave open: else shifts of thresholds were told that there are not."""
    true, told = of(each_second, alpha), of(rows(each_second, every, value), alpha)
    assert len(told.events) > 0.9 * len(true.events)
    its = nearest(told, true, 3 if value == "instant" else 0)
    (level_m, slope_m_s), true_m = told.stretches.lines(), true.stretches.lines()[0][its]
    noise_m = alpha.sensors.level_noise_m
    off_m2 = noise_m**2 * told.stretches.leverage + told.bent_m**2 + (told.open_s * slope_m_s) ** 2 / 12.0
    ratio = (level_m - true_m) / np.sqrt(off_m2)
    assert abs(np.mean(ratio)) < 0.5
    assert 0.3 < np.sqrt(np.mean(ratio**2)) < 1.5


def test_a_mean_of_even_seconds_is_half_a_second_off_none_of_them(alpha, each_second):
    """The level rises by 2 to 3 mm/s: half a second is over a millimetre."""
    true, told = of(each_second, alpha), of(rows(each_second, 10, "mean"), alpha)
    is_start = np.array([event.is_start for event in told.events])
    off_m = told.stretches.lines()[0] - true.stretches.lines()[0][nearest(told, true, 0)]
    assert abs(np.mean(off_m[is_start])) < 0.0005


def test_stops_of_which_few_have_a_line_tell_of_no_level(alpha, each_second):
    """Runs take four to five minutes: the rows of those that have a line came at certain times."""
    told = of(rows(each_second, 120, "instant"), alpha)
    assert told.events
    assert all(event.is_start for event in told.events)


def test_rows_that_hide_whole_cycles_tell_of_no_level(alpha, each_second):
    assert of(rows(each_second, 240, "instant"), alpha).events == ()


def test_a_row_that_is_lost_tells_of_no_switch_about_it(alpha, each_second):
    recording = rows(each_second, 60, "instant")
    whole = of(recording, alpha)
    after = int(np.searchsorted(recording.time_ns, recording.time_ns[0] + whole.stretches.second[5] * 10**9, "right"))
    kept = np.delete(np.arange(len(recording)), after)
    columns = {name: values[kept] for name, values in recording.columns.items()}
    less = of(replace(recording, time_ns=recording.time_ns[kept], columns=columns), alpha)
    assert len(less.events) == len(whole.events) - 1
