"""What is left open where a pump is switched faster than a recording shows."""

import numpy as np

from wetwell.sim2real.residuals.signals import _unresolved


def test_a_jump_is_open_by_half_when_it_happens_and_by_less_and_less_afterwards():
    expected = np.r_[np.zeros(3), np.full(9, 100.0)]
    is_step = np.arange(12) == 3
    open_m3h = _unresolved(expected, is_step)
    np.testing.assert_allclose(open_m3h[:3], 0.0)
    np.testing.assert_allclose(open_m3h[3:8], 50.0 * np.exp(-np.arange(5.0)))
    np.testing.assert_allclose(open_m3h[8:], 0.0)


def test_a_slow_ramp_leaves_nothing_open():
    assert not np.any(_unresolved(np.linspace(0.0, 100.0, 12), np.zeros(12, dtype=bool)))
