"""Ticks of daemons, on a virtual clock."""

import asyncio

import pytest
from virtual_loop import run_virtual

from wetwell.services.runtime.lifecycle import ticks


async def times_of(count: int, lead_s: float, busy_s: float = 0.0) -> list[float]:
    loop, times = asyncio.get_running_loop(), []
    async for _ in ticks(10.0, lead_s):
        times.append(loop.time())
        if len(times) == count:
            return times
        await asyncio.sleep(busy_s)
    raise AssertionError("ticks ended")


def test_ticks_do_not_drift_and_late_ones_are_skipped():
    assert run_virtual(times_of(3, 0.0, busy_s=4.0)) == pytest.approx([0.0, 10.0, 20.0])
    assert run_virtual(times_of(3, 0.0, busy_s=14.0)) == pytest.approx([0.0, 20.0, 40.0])


@pytest.mark.parametrize("lead_s", [2.5, 9.99])
def test_those_with_another_lead_begin_together_and_tick_apart(lead_s):
    assert run_virtual(times_of(3, lead_s)) == pytest.approx([0.0, 10.0 - lead_s, 20.0 - lead_s])
