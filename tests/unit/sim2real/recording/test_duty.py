"""Running times within intervals of which only the mean is known."""

import numpy as np
import pytest

from wetwell.sim2real.recording.duty import Intervals, drives_of_means


def means(frequency_hz, every):
    """(pumps, rows) means, and the intervals."""
    count = frequency_hz.shape[1] // every
    last = np.arange(1, count + 1) * every - 1
    return (
        frequency_hz.reshape(frequency_hz.shape[0], count, every).mean(axis=2),
        Intervals(last=last, length_s=every, seconds=count * every),
    )


def runs(station, starts, length_s, seconds=7200):
    """Pumps in turn, started at these seconds for so long."""
    ramp_s = station.control.ramp_s
    second = np.arange(seconds)
    hz = np.zeros((len(station.pump), seconds))
    for k, start in enumerate(starts):
        up, down = (second - start) / ramp_s, (start + length_s - second) / ramp_s + 1.0
        hz[k % hz.shape[0]] = np.maximum(hz[k % hz.shape[0]], 50.0 * np.clip(np.minimum(up, down), 0.0, 1.0))
    return hz


@pytest.mark.parametrize("every", [10, 60])
def test_a_run_over_several_intervals_is_laid_where_it_was(alpha, every):
    true_hz = runs(alpha, [307, 1533, 3018, 5202], 400)
    mean_hz, intervals = means(true_hz, every)
    drives = drives_of_means(mean_hz, np.full_like(mean_hz, np.nan), intervals, alpha)
    assert np.abs(drives.frequency_hz - true_hz).mean() < 0.1
    assert np.abs(np.diff(drives.frequency_hz)).max() <= 50.0 / alpha.control.ramp_s + 1e-9


@pytest.mark.parametrize("every", [10, 60, 900])
def test_the_mean_of_each_interval_is_that_of_the_row(alpha, every):
    mean_hz, intervals = means(runs(alpha, np.arange(200, 6800, 450), 180), every)
    drives = drives_of_means(mean_hz, np.full_like(mean_hz, np.nan), intervals, alpha)
    for laid in (drives.frequency_hz, *drives.placements):
        seconds_off = np.abs(means(laid, every)[0] - mean_hz) * every / 50.0
        assert np.quantile(seconds_off, 0.95) < 8.0
    assert len(drives.placements) == 4


def test_pumps_that_run_one_after_the_other_do_not_run_at_once(alpha):
    mean_hz, intervals = means(runs(alpha, np.arange(200, 6800, 450), 180), 900)
    drives = drives_of_means(mean_hz, np.full_like(mean_hz, np.nan), intervals, alpha)
    assert np.sum(np.sum(drives.frequency_hz > 0.0, axis=0) > 1) < 0.01 * intervals.seconds


def test_a_drive_of_any_speed_runs_at_the_mean_of_an_interval_that_it_ran_throughout(alpha):
    control = alpha.control.model_copy(update={"mode": "external", "start_levels_m": (), "stop_levels_m": ()})
    station = alpha.model_copy(update={"control": control})
    mean_hz = np.array([[0.0, 20.0, 40.0, 41.0, 42.0, 10.0, 0.0]] * len(station.pump))
    share = np.array([[0.0, 0.5, 1.0, 1.0, 1.0, 0.25, 0.0]] * len(station.pump))
    intervals = Intervals(last=np.arange(1, 8) * 900 - 1, length_s=900, seconds=6300)
    hz = drives_of_means(mean_hz, share, intervals, station).frequency_hz[0]
    assert hz[2300] == pytest.approx(40.0)
    assert hz[1700] == pytest.approx(41.0)  # what it usually ran at
    assert hz[950] == 0.0
    assert hz[4600] > 40.0
    assert not hz[4800:].any()
