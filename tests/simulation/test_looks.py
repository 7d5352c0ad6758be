"""Time on the virtual clock: what is due at once comes in order, and looks end when each of them would have."""

import asyncio

import pytest
from looks import Looks
from virtual_loop import run_virtual


def test_what_is_due_at_the_same_time_comes_in_the_order_of_its_making_whatever_else_waits():
    async def order(others: int) -> list[int]:
        loop, seen = asyncio.get_running_loop(), []
        for other in range(others):
            loop.call_later(1.0 + other % 7, int)
        for number in range(20):
            loop.call_at(5.0, seen.append, number)
        await asyncio.sleep(10.0)
        return seen

    assert run_virtual(order(0)) == run_virtual(order(50)) == list(range(20))


@pytest.mark.parametrize(("told_s", "ends_s"), [(3.0, 10.0), (10.0, 10.0), (34.0, 40.0)])
def test_a_wait_ends_with_the_period_in_which_something_may_show(told_s, ends_s):
    async def wait() -> float:
        looks, loop = Looks(), asyncio.get_running_loop()
        loop.call_at(told_s, looks.matter)
        loop.call_at(told_s, looks.matter)  # twice is fine
        await looks.sleep(10.0)
        return loop.time()

    assert run_virtual(wait()) == ends_s
