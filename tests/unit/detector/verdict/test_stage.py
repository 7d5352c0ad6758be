"""What to do about a fault: by its size, what is not known of it, and how it grows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.detector.inference.size_track import SizeTrack
from wetwell.detector.verdict.stage import STAGES, Quantity, severity_of, stage_of, trend_of
from wetwell.protocols.timestamps import NS_PER_DAY

FRICTION = Quantity("friction_rise_percent", 15.0, 0.15, lambda rise: 100.0 * rise)
SIZES = st.floats(-1.0, 1.0)
DEVIATIONS = st.floats(1e-4, 0.3)


def test_a_limit_must_be_passed_with_95_percent():
    assert stage_of(0.15 + 1.64 * 0.01, 0.01**2, 0.15, None) == "plan"
    assert stage_of(0.15 + 1.65 * 0.01, 0.01**2, 0.15, None) == "act"
    assert stage_of(0.075 + 1.64 * 0.01, 0.01**2, 0.15, None) == "watch"
    assert stage_of(0.075 + 1.65 * 0.01, 0.01**2, 0.15, None) == "plan"


@given(SIZES, DEVIATIONS, st.sampled_from(STAGES))
def test_a_stage_once_told_is_left_only_with_certainty(size, deviation, before):
    fresh = stage_of(size, deviation**2, 0.15, None)
    again = stage_of(size, deviation**2, 0.15, before)
    assert STAGES.index(fresh) <= STAGES.index(again) <= max(STAGES.index(fresh), STAGES.index(before))
    assert stage_of(size, deviation**2, 0.15, again) == again, "the same run again changes nothing"


@given(SIZES, DEVIATIONS)
def test_a_burst_counts_like_a_clog(size, deviation):
    assert stage_of(size, deviation**2, 0.15, None) == stage_of(-size, deviation**2, 0.15, None)


def test_a_severity_has_its_interval_in_order():
    told = severity_of(-0.1, 0.01**2, FRICTION)
    assert (told.value, told.interval, told.limit) == (-10.0, (-11.96, -8.04), 15.0)


def grown(rate, days):
    rng, track = np.random.default_rng(3), SizeTrack()
    for at in np.arange(0.0, days, 1.0 / 50.0):
        track.update(
            round(at * NS_PER_DAY), rate * at + 0.003 * rng.normal(), 0.003**2, 0.3, 0.0, 0.05, is_sure=False
        )
    return track


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_date_is_that_of_the_line_and_lies_within_its_interval(sign):
    told = trend_of(grown(0.015 * sign, 5.0), 0.3, FRICTION)
    assert told.per_day == pytest.approx(1.5 * sign, rel=0.15)
    assert told.interval[0] < told.per_day < told.interval[1]
    assert told.reaches_limit == pytest.approx(10.0 * NS_PER_DAY, rel=0.15)
    earliest, latest = told.interval_at
    assert earliest < told.reaches_limit
    assert latest is None or latest > told.reaches_limit


def test_what_has_passed_its_limit_has_no_date():
    passed = trend_of(grown(0.04, 5.0), 0.3, FRICTION)
    assert passed.reaches_limit is None
    assert passed.interval_at == (None, None)
