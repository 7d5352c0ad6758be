"""Several recordings as one."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.orders import Step
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.recording.excerpt import BLANK_S
from wetwell.sim2real.recording.joining import joined
from wetwell.sim2real.recording.traces import BETWEEN, traces_of
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOUR_NS = 3600 * 10**9
STEPS = (Step(longest_s=900, speed_ratio=(0.8, 0.0, 0.0)),)


def recorded(station, start_ns, seconds=7200, steps=()):
    return Simulation(station, Scenario(name="plain"), 3, start_ns, steps).advance(seconds, truth=False)


@pytest.fixture(scope="module")
def parts(alpha):
    return [
        traces_of(recorded(alpha, 0), alpha, least_starts=1),
        traces_of(recorded(alpha, 5 * HOUR_NS, 3600, STEPS), alpha, least_starts=1),
    ]


def test_each_second_keeps_its_values_its_time_and_whose_it_is(parts):
    first, second = parts
    together = joined(parts[::-1])  # in whatever order they are given
    ends = np.flatnonzero(together.part == 0)
    begins = np.flatnonzero(together.part == 1)
    assert begins[0] - ends[-1] - 1 == BLANK_S == np.sum(together.part == BETWEEN)
    assert ends.size > first.seconds - 900
    seconds = together.time_s.astype(int)
    assert np.array_equal(together.level_m[ends], first.level_m[seconds[ends]])
    at = seconds[begins] - 5 * 3600
    assert np.array_equal(together.level_m[begins], second.level_m[at])
    assert np.array_equal(together.signals["flow_m3h"][:, begins], second.signals["flow_m3h"][:, at])
    assert np.array_equal(together.by_hand.is_commanding[begins], second.by_hand.is_commanding[at])
    assert np.isnan(together.level_m[together.part == BETWEEN]).all()
    assert np.all(np.diff(together.time_s) > 0.0)


def test_no_run_is_cut(parts):
    together = joined(parts)
    edges = np.flatnonzero(np.diff(together.part)) + np.array([0, 1])
    assert not together.frequency_hz[:, edges].any()
    assert not together.frequency_hz[:, together.part == BETWEEN].any()


def test_one_recording_is_itself(parts):
    assert joined(parts[:1]) is parts[0]


def test_a_signal_that_one_lacks_has_no_values_there_and_an_inflow_counts_where_all_have_it(parts):
    first, second = parts
    without = replace(second, inflow_m3h=None, signals={"head_m": second.signals["head_m"]})
    together = joined([first, without])
    assert together.inflow_m3h is None
    is_second = together.part == 1
    assert np.isnan(together.signals["flow_m3h"][:, is_second]).all()
    assert np.isfinite(together.signals["flow_m3h"][:, together.part == 0]).any()
    assert np.isfinite(together.signals["head_m"][:, is_second]).any()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"rate_s": 60.0}, "recordings of one rate are needed, got 1 s and 60 s"),
        ({"value": "mean"}, "one kind of value are needed, got 'instant' and 'mean'"),
        ({"start_ns": HOUR_NS}, "overlap in time"),
    ],
)
def test_what_does_not_fit_together_is_refused(parts, changes, told):
    with pytest.raises(ValueError, match=told):
        joined([parts[0], replace(parts[1], **changes)])


def test_what_is_left_of_several_recordings_must_show_enough_starts(alpha):
    few = [recorded(alpha, hour * HOUR_NS, 1801) for hour in (0, 5)]
    with pytest.raises(ValueError, match=r"^the recordings have, without runs that one .* with, \d starts of pumps"):
        diagnose(few, alpha)
