"""What residuals leave open: moments of switching, values under a cutoff, values that were not sent again."""

import numpy as np
import pytest

from wetwell.sim2real.recording.regimes import IDLE, START_RAMP, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.signals import _cut, _since, _unresolved, pump_residuals
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation


def test_a_jump_is_open_by_half_when_it_happens_and_by_less_and_less_afterwards():
    expected = np.r_[np.zeros(3), np.full(9, 100.0)]
    is_step = np.arange(12) == 3
    open_m3h = _unresolved(expected, expected, is_step, *starting_at(3, 12))
    np.testing.assert_allclose(open_m3h[:3], 0.0)
    np.testing.assert_allclose(open_m3h[3:8], 50.0 * np.exp(-np.arange(5.0)))
    np.testing.assert_allclose(open_m3h[8:], 0.0)


def test_a_jump_that_comes_late_is_open_where_it_comes():
    """Not where one record jumps: noise is no jump, as ramps do not have it at the same second."""
    count = 40
    expected = np.tile(np.r_[np.zeros(3), np.full(17, 100.0)], count)
    recorded = np.tile(np.r_[np.zeros(10), np.full(10, 80.0)], count)
    regime, is_ramp = (np.tile(one, count) for one in starting_at(3, 20))
    is_step = np.tile(np.arange(20) == 3, count)
    noise = np.random.default_rng(1).normal(0.0, 1.0, recorded.size)
    open_m3h = _unresolved(expected, recorded + noise, is_step, regime, is_ramp)
    by_second = open_m3h.reshape(count, 20)
    np.testing.assert_allclose(by_second[:, 3], 50.0)
    np.testing.assert_allclose(by_second[:, 10], 40.0, atol=0.5)
    np.testing.assert_allclose(by_second[:, 12], 40.0 * np.exp(-2.0), atol=0.5)


def test_a_slow_ramp_leaves_nothing_open():
    slow = np.linspace(0.0, 100.0, 12)
    assert not np.any(_unresolved(slow, slow, np.zeros(12, dtype=bool), *starting_at(0, 12)))


def starting_at(second, seconds):
    """(seconds,) regimes in which a start begins at a second, and whether it is one."""
    is_ramp = np.arange(seconds) >= second
    return np.where(is_ramp, START_RAMP, IDLE), is_ramp


@pytest.mark.parametrize(
    ("recorded", "predicted", "left"),
    [
        (0.0, 0.0, 0.0),
        (0.0, 31.0, -1.0),
        (4e-320, 31.0, -1.0),
        (31.0, 0.0, 1.0),
        (31.0, 33.0, -2.0),
        (12.0, 0.0, 12.0),
        (12.0, 33.0, -21.0),
    ],
)
def test_a_zero_says_only_that_a_flow_was_under_the_cutoff(recorded, predicted, left):
    recorded, predicted = np.array([recorded]), np.array([predicted])
    assert recorded - predicted - _cut(recorded, predicted, 30.0) == pytest.approx(left)


def test_a_value_that_waits_may_be_any_that_it_had_since():
    low, high = _since(np.array([3.0, 5.0, 4.0, 9.0, 2.0]), 2)
    np.testing.assert_array_equal(low, [3.0, 3.0, 3.0, 4.0, 2.0])
    np.testing.assert_array_equal(high, [3.0, 5.0, 5.0, 9.0, 9.0])


def test_what_pumps_take_from_a_drained_wet_well_is_not_compared(alpha):
    """A controller that is late pumps it empty: what a pump does then is air and water, and no curve."""
    late = alpha.model_copy(update={"effect": (EFFECTS["control_delay"](delay_s=100.0),)})
    traces = traces_of(Simulation(late, Scenario(name="plain"), 7, 0).advance(14_400, truth=False), alpha)
    is_low = (traces.level_m < 0.02) & np.any(traces.frequency_hz > 0.0, axis=0)
    assert is_low.sum() > 60
    replay = Replay(traces, alpha)
    found = pump_residuals(
        traces, alpha, regimes_of(traces, alpha), replay.run(), replay.doubt(is_level_held=False), {}
    )
    compared = np.unique(np.concatenate([one.seconds.second for one in found]))
    assert not is_low[compared].any()
    is_running = np.any(traces.frequency_hz > 0.0, axis=0)
    assert is_running[compared].sum() > 0.8 * (is_running & (traces.level_m > 0.1)).sum()


def test_a_reading_that_moves_late_may_be_as_early_or_late_as_one_that_was_expected_to(alpha):
    """A flow that falls six seconds after it is expected to: where it falls, nothing was expected to move."""
    late = alpha.model_copy(update={"effect": (EFFECTS["channel_delay"](channel="flow_m3h", delay_s=6.0),)})
    traces = traces_of(Simulation(late, Scenario(name="plain"), 7, 0).advance(14_400, truth=False), alpha)
    replay = Replay(traces, alpha)
    plain = replay.run()
    found = pump_residuals(traces, alpha, regimes_of(traces, alpha), plain, replay.doubt(is_level_held=False), {})
    for one in (one for one in found if one.name == "flow_m3h"):
        falls_m3h_s = np.abs(one.seconds.means(np.gradient(traces.signals["flow_m3h"][one.pump])))
        expected_m3h = one.seconds.means(plain.signals["flow_m3h"][one.pump])
        moves_late = (expected_m3h == 0.0) & (falls_m3h_s > 20.0)
        assert moves_late.sum() > 20
        allowed_m3h = (one.bins.material * one.bins.deviation)[moves_late]
        assert np.all(allowed_m3h > 0.8 * alpha.materiality.time_s * falls_m3h_s[moves_late])
