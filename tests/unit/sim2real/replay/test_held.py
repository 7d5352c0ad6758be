"""What the moves of a channel tell of a deadband that holds it."""

import numpy as np
import pytest

from wetwell.sim2real.replay.held import held_each_second, moves_of

SECONDS = 12_000


@pytest.mark.parametrize("step", [0.1, 0.2, 0.5])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mean", [4.0, 10.0, 20.0, 33.0])
def test_noise_in_steps_of_storage_whose_seconds_come_twice_at_times_is_not_held(step, seed, mean):
    """The sizes of moves by a few steps pile up by the rounding of floating point alone."""
    noise = np.random.default_rng(seed).normal(0.0, 14.5 * step, SECONDS)
    stored, seconds = step * np.round((mean + noise) / step), np.arange(SECONDS)
    values = stored[seconds - (seconds % 4 == 1)]
    moves = moves_of([values], np.zeros((1, SECONDS), dtype=np.bool_), 1.0)
    assert held_each_second(moves, step) is None
