"""Which trends can be those of what was published."""

import numpy as np
import pytest
from kept_rules import is_within

from wetwell.services.historian.samples import Samples
from wetwell.services.historian.summary import Summary

NONE = float("nan")


def summary(*values: float) -> Summary:
    count = np.arange(len(values))
    samples = Samples(
        time_ns=count, seq=count, quality=count * 0, values=np.array([[value, NONE] for value in values])
    )
    return Summary.of(samples).over(0, 10)


@pytest.mark.parametrize("kept", [(1.0, 4.0, 2.0), (1.0, 4.0), (2.0,), (NONE, 2.0)])
def test_a_trend_of_all_or_some_values_is_one(kept):
    assert is_within(summary(*kept), summary(1.0, 4.0, 2.0))


@pytest.mark.parametrize("kept", [(1.0, 4.0, 3.0), (1.0, 5.0), (0.5,), (1.0, 4.0, 2.0, 2.0)])
def test_a_trend_with_another_value_or_too_many_is_none(kept):
    assert not is_within(summary(*kept), summary(1.0, 4.0, 2.0))
