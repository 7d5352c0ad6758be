"""Which seconds of a plant are due: a pure policy, so no clock is needed to test it."""

from hypothesis import given
from hypothesis import strategies as st

from wetwell.protocols.messages.plant_clock import PlantClockOrder
from wetwell.services.simulator.orders import carry_out
from wetwell.services.simulator.pace import LOOK_SPEED, MAX_CATCH_UP_S, Pace


@given(speed=st.floats(0.01, 10_000.0), waits=st.lists(st.floats(0.0, 100.0), min_size=1, max_size=50))
def test_after_each_tick_as_many_seconds_are_done_as_have_passed(speed: float, waits: list[float]) -> None:
    pace, now_s, done = Pace(speed, 0.0), 0.0, 0
    for wait_s in waits:
        now_s += wait_s
        due = pace.take_due(now_s)
        assert 0 <= due <= MAX_CATCH_UP_S
        done += due
        assert abs(done - (now_s * speed + 1.0)) <= 1.0 + 1e-6 * now_s * speed or due == MAX_CATCH_UP_S


@given(
    acts=st.lists(
        st.tuples(
            st.floats(0.0, 5.0), st.sampled_from([None, True, False]), st.sampled_from([None, 1.0, 60.0, 600.0, 9e5])
        )
    )
)
def test_whatever_is_ordered_the_plant_makes_up_the_time_that_it_was_let_go_at_the_speed_of_then(acts) -> None:
    """Against a sum by hand: the speed in force times the time that it was."""
    pace, now_s, speed, is_held, passed, done = Pace(600.0, 0.0), 0.0, 600.0, False, 1.0, 0
    for wait_s, hold, other in acts:
        now_s += wait_s
        passed += 0.0 if is_held else wait_s * speed
        carry_out(PlantClockOrder(is_held=hold, speed=other), pace, now_s)
        is_held = is_held if hold is None else hold
        speed = speed if other is None else min(other, 600.0)
        done += pace.take_due(now_s)
    carry_out(PlantClockOrder(is_held=False), pace, now_s)
    while due := pace.take_due(now_s):
        done += due
    assert abs(done - passed) <= 1.0


def test_a_look_is_slow_ends_by_itself_and_a_longer_one_stays() -> None:
    pace = Pace(600.0, 0.0)
    pace.take_due(0.0)
    pace.look(0.0, 4.0)
    pace.look(1.0, 1.0)
    assert pace.take_due(3.0) == 3 * LOOK_SPEED
    assert pace.speed == LOOK_SPEED
    assert pace.take_due(5.0) == LOOK_SPEED + 600
    assert pace.speed == 600.0


def test_a_look_does_not_speed_up_a_slow_plant_and_an_ordered_speed_ends_it() -> None:
    slow = Pace(1.0, 0.0)
    slow.take_due(0.0)
    slow.look(0.0, 10.0)
    assert slow.take_due(5.0) == 5
    fast = Pace(600.0, 0.0)
    fast.take_due(0.0)
    fast.look(0.0, 10.0)
    fast.set_speed(0.0, 300.0)
    assert fast.take_due(1.0) == 300


def test_a_plant_that_is_held_makes_up_nothing() -> None:
    pace = Pace(600.0, 0.0, is_held=True)
    assert pace.take_due(1_000.0) == 0
    pace.look(1_000.0, 4.0)
    pace.release(1_000.0)
    assert pace.take_due(1_000.0) == 1
    assert pace.take_due(1_001.0) == 600, "a look at a plant that stands is none"
