"""Whether a sum over cycles is beyond chance."""

import numpy as np
import pytest

from wetwell.sim2real.attribution.significance import is_significant


@pytest.mark.parametrize(
    ("by_cycle", "sure"),
    [
        ([1.0] * 20, True),
        ([1.0, -1.0] * 10, False),
        ([0.0] * 90 + [500.0] * 4, True),
        ([0.0] * 90 + [500.0] * 2, False),
        ([0.0] * 90 + [1500.0] * 2, True),  # pumps that seldom run together
        ([0.0] * 90 + [1500.0], False),
        ([0.0] * 90 + [1500.0] * 2 + [-900.0], False),
        ([], False),
    ],
)
def test_a_gain_is_sure_where_cycles_agree_or_few_gain_much(by_cycle, sure):
    assert is_significant(np.array(by_cycle)) is sure
