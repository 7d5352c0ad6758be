"""Compiled functions that look at the types of their arguments once."""

import numpy as np

from wetwell.protocols.jit import SameTypes, compiled


@compiled
def add_to(values, share):
    for at in range(values.shape[0]):
        values[at] += share
    return values.shape[0]


def test_each_call_gets_its_own_arguments():
    add = SameTypes(add_to)
    first, second = np.zeros(3), np.ones(5)
    assert [add(first, 0.5), add(second, 2.0)] == [3, 5]
    assert (first.tolist(), second.tolist()) == ([0.5] * 3, [3.0] * 5)


def test_a_function_that_is_not_compiled_is_called_as_it_is():
    assert SameTypes(max)(2, 7) == 7
