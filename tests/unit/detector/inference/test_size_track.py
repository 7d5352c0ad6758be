"""The size of a fault over time, on series of which the truth is known."""

import numpy as np
import pytest

from wetwell.detector.inference.size_track import SizeTrack
from wetwell.protocols.timestamps import NS_PER_DAY

SCALE, NOISE, CHANGE = 0.3, 0.004, 0.05
RUNS_A_DAY = 60


def after(days, size_at, seed=1, disturbance=0.0, *, is_sure=False):
    """Track of a fault whose size is a function of time in days; runs are disturbed by a daily wave."""
    rng, track = np.random.default_rng(seed), SizeTrack()
    anew = 0
    for at in np.arange(0.0, days, 1.0 / RUNS_A_DAY):
        value = size_at(at) + NOISE * rng.normal() + np.sqrt(2.0 * disturbance) * np.sin(2.0 * np.pi * at)
        anew += track.update(round(at * NS_PER_DAY), value, NOISE**2, SCALE, disturbance, CHANGE, is_sure=is_sure)
    return track, anew


@pytest.mark.parametrize("seed", range(5))
def test_a_fault_that_grows_is_told_with_its_rate_and_without_beginning_anew(seed):
    track, anew = after(10.0, lambda at: 0.02 * max(at - 2.0, 0.0), seed)
    assert anew == 0
    size, variance = track.size
    assert size == pytest.approx(0.16, abs=4.0 * variance**0.5)
    assert variance**0.5 < NOISE
    rate, variance = track.rate
    assert rate == pytest.approx(0.02, abs=3.0 * variance**0.5)
    assert rate == pytest.approx(0.02, rel=0.25)


def test_a_fault_that_goes_is_gone_with_its_first_run():
    track, anew = after(3.0 + 0.5 / RUNS_A_DAY, lambda at: 0.2 if 1.0 <= at < 3.0 else 0.0, is_sure=True)
    assert anew == 2, "it came and it went"
    assert abs(track.size[0]) < 3.0 * NOISE
    assert abs(track.rate[0]) < 0.1


def test_one_strange_run_is_left_out_and_two_begin_anew():
    track, _ = after(3.0, lambda at: 0.02 * at)
    size, rate = track.size, track.rate
    at_ns = round(3.01 * NS_PER_DAY)
    assert not track.update(at_ns, 0.5, NOISE**2, SCALE, 0.0, CHANGE, is_sure=False)
    assert track.size[0] == pytest.approx(size[0], abs=0.01)
    assert track.rate[0] == pytest.approx(rate[0], rel=0.01)
    assert track.update(at_ns, 0.5, NOISE**2, SCALE, 0.0, CHANGE, is_sure=False)
    assert track.size[0] == pytest.approx(0.5)


def test_a_daily_wave_is_no_trend():
    rates = []
    for seed in range(5):
        track, anew = after(8.3, lambda _: 0.0, seed, disturbance=0.01**2)
        rate, variance = track.rate
        assert anew == 0
        assert abs(rate) < 3.0 * variance**0.5, "a trend must not be surer than its disturbances let it be"
        rates.append(rate)
    assert np.abs(rates).max() < 0.01


def test_what_lies_ahead_is_the_line_and_grows_less_sure():
    track, _ = after(6.0, lambda at: 0.02 * at)
    size, variance = track.size
    days = np.array([1e-9, 1.0, 5.0, 20.0])
    means, variances = track.ahead(days, SCALE)
    assert means == pytest.approx(size + track.rate[0] * days)
    assert variances[0] == pytest.approx(variance, rel=1e-6)
    assert (np.diff(variances) > 0.0).all()


def test_a_clock_that_is_set_back_is_a_run_at_the_same_time():
    track, _ = after(2.0, lambda _: 0.0)
    before, rate = track.size, track.rate
    track.update(round(1.0 * NS_PER_DAY), 0.0, NOISE**2, SCALE, 0.0, CHANGE, is_sure=False)
    assert track.size[1] < before[1]
    assert track.rate[0] == pytest.approx(rate[0], abs=0.01)
