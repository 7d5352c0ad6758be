"""Which seconds are due: a pure policy, so no clock is needed to test it."""

from hypothesis import given
from hypothesis import strategies as st

from wetwell.services.runtime.clock import MAX_CATCH_UP_S, due_seconds


@given(
    speed=st.floats(0.01, 10_000.0),
    waits=st.lists(st.floats(0.0, 100.0), min_size=1, max_size=50),
)
def test_after_each_tick_as_many_seconds_are_done_as_have_passed(speed: float, waits: list[float]) -> None:
    elapsed_s, done = 0.0, 0
    for wait_s in waits:
        elapsed_s += wait_s
        due = due_seconds(elapsed_s, speed, done)
        assert 0 <= due <= MAX_CATCH_UP_S
        done += due
        passed = int(elapsed_s * speed + 1e-6) + 1
        assert done == passed or due == MAX_CATCH_UP_S
