"""What drives have done between two rows."""

import numpy as np
import pytest

from wetwell.sim2real.recording.drives import drives_between

NOMINAL_HZ = np.array([50.0])
RAMP_S = 10.0


def thinned(frequency_hz, every):
    rows = np.full(frequency_hz.size, np.nan)
    rows[::every] = frequency_hz[::every]
    return rows[None, :]


def one_run(start, stop, seconds=200):
    """A run of a drive that is started and stopped at these seconds."""
    second = np.arange(seconds)
    return np.clip(np.minimum((second - start) * 5.0, 50.0 - (second - stop) * 5.0), 0.0, 50.0)


def test_a_recording_of_each_second_stays_as_it_is():
    run = one_run(42, 130)
    drives = drives_between(run[None, :], NOMINAL_HZ, RAMP_S, 1.0)
    np.testing.assert_array_equal(drives.frequency_hz[0], run)
    assert drives.placements == ()
    assert not drives.open_s.any()


def test_a_row_within_each_ramp_says_when_they_were():
    run = one_run(44, 134)
    drives = drives_between(thinned(run, 10), NOMINAL_HZ, RAMP_S, 10.0)
    np.testing.assert_allclose(drives.frequency_hz[0], run, atol=1e-9)
    assert drives.placements == ()


def test_a_start_between_rows_lies_in_the_middle_of_what_is_possible():
    drives = drives_between(thinned(one_run(45, 125), 60), NOMINAL_HZ, RAMP_S, 60.0)
    starts = [int(np.argmax(hz[0] > 0.0)) for hz in (drives.frequency_hz, *drives.placements)]
    assert starts == [26, 1, 51, 1, 51]
    stops = [int(np.argmax(hz[0, 120:] == 0.0)) + 120 for hz in (drives.frequency_hz, *drives.placements)]
    assert stops == [155, 130, 180, 180, 130]
    assert drives.open_s[0, [60, 180]] == pytest.approx(50.0)


def test_a_speed_that_rises_slowly_from_row_to_row_rises_between_them():
    rising = np.linspace(30.0, 45.0, 301)
    drives = drives_between(thinned(rising, 60), NOMINAL_HZ, RAMP_S, 60.0)
    np.testing.assert_allclose(drives.frequency_hz[0, 60:240], rising[60:240], atol=1e-9)


def test_over_a_long_pause_nothing_is_made_up():
    rows = np.full((1, 2000), np.nan)
    rows[0, :100:10], rows[0, 1500::10] = 50.0, 0.0
    drives = drives_between(rows, NOMINAL_HZ, RAMP_S, 10.0)
    assert drives.frequency_hz[0, 200] == 50.0
    assert not drives.frequency_hz[0, 300:].any()
