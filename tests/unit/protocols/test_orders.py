"""Orders of an operator: which step is in force when."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.protocols.orders import AUTOMATIC, Step, first_place, go_on, orders_of, valves

levels = st.lists(st.floats(0.0, 3.0), min_size=1, max_size=60)
steps = st.lists(
    st.builds(
        Step,
        longest_s=st.integers(0, 12).map(float),
        speed_ratio=st.one_of(st.none(), st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0))),
        low_m=st.one_of(st.just(-math.inf), st.floats(0.0, 1.5)),
        high_m=st.one_of(st.just(math.inf), st.floats(1.5, 3.0)),
    ),
    max_size=5,
)


@given(steps, levels)
def test_steps_come_in_order_last_as_long_as_they_may_and_never_beyond_their_levels(steps, levels):
    orders, place = orders_of(steps, 2), first_place()
    taken = [go_on(orders, place, level_m) for level_m in levels]
    numbers = [step if step != AUTOMATIC else len(steps) for step in taken]
    assert numbers == sorted(numbers)
    for step, level_m in zip(taken, levels, strict=True):
        assert step == AUTOMATIC or steps[step].low_m < level_m < steps[step].high_m
    for number, step in enumerate(steps):
        assert taken.count(number) <= step.longest_s


def test_without_steps_the_controller_is_alone_and_all_valves_are_open():
    orders, place = orders_of([], 2), first_place()
    assert go_on(orders, place, 1.0) == AUTOMATIC
    assert valves(orders, AUTOMATIC) == (1.0, 1.0)
    assert orders.columns(np.full(3, AUTOMATIC)) == {}


def test_columns_tell_what_was_done():
    steps = [Step(longest_s=1), Step(longest_s=1, speed_ratio=(1.0,), is_valve_shut=True, is_inlet_shut=True)]
    columns = orders_of(steps, 1).columns(np.array([AUTOMATIC, 0, 1]))
    assert {name: values.tolist() for name, values in columns.items()} == {
        "by_hand": [0.0, 0.0, 1.0],
        "valve_open": [1.0, 1.0, 0.0],
        "inlet_open": [1.0, 1.0, 0.0],
    }


@pytest.mark.parametrize(
    ("ratio", "told"),
    [((1.0,), "step 1: speed_ratio: got 1 speeds, the station has 2 pumps"), ((1.2, 0.0), "must be from 0 to 1")],
)
def test_steps_that_no_station_can_take_are_refused(ratio, told):
    with pytest.raises(ValueError, match=told):
        orders_of([Step(longest_s=1, speed_ratio=ratio)], 2)
