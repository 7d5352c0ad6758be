"""Ticks and health of daemons, on a virtual clock."""

import asyncio
from collections import Counter
from itertools import pairwise

import pytest
from memory_bus import MemoryBus
from virtual_loop import run_virtual

from wetwell.protocols.bus.keys import status_key
from wetwell.protocols.messages.status import Status
from wetwell.services.runtime.lifecycle import TURN_S, report_health_in_turn, ticks


async def times_of(count: int, busy_s: float = 0.0) -> list[float]:
    loop, times = asyncio.get_running_loop(), []
    async for _ in ticks(10.0):
        times.append(loop.time())
        if len(times) == count:
            return times
        await asyncio.sleep(busy_s)
    raise AssertionError("ticks ended")


def test_ticks_do_not_drift_and_late_ones_are_skipped():
    assert run_virtual(times_of(3, busy_s=4.0)) == pytest.approx([0.0, 10.0, 20.0])
    assert run_virtual(times_of(3, busy_s=14.0)) == pytest.approx([0.0, 20.0, 40.0])


async def told_by(stations: int, period_s: float, until_s: float) -> list[tuple[float, str]]:
    """When which station's health is told."""
    loop, bus, told = asyncio.get_running_loop(), MemoryBus(), []
    statuses = bus.subscribe(status_key("*", "detector"))

    async def listen() -> None:
        while True:
            told.extend((loop.time(), Status.decode(each).station) for each in await statuses.receive())

    figures = {f"s{number}": dict for number in range(stations)}
    tasks = [
        asyncio.create_task(listen()),
        asyncio.create_task(report_health_in_turn(bus, "detector", period_s, figures)),
    ]
    await asyncio.sleep(until_s)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return told


@pytest.mark.parametrize("stations", [1, 7, 1_000])
def test_many_stations_tell_at_once_and_then_in_turns(stations):
    periods = 5
    told = run_virtual(told_by(stations, 10.0, periods * 10.0 + 1.0))
    assert len({station for now_s, station in told if now_s == 0.0}) == stations
    later = [each for each in told if each[0] > 0.0]
    for number in range(stations):
        times = [now_s for now_s, station in later if station == f"s{number}"]
        assert len(times) in (periods, periods + 1), number
        assert [b - a for a, b in pairwise(times)] == pytest.approx([10.0] * (len(times) - 1)), number
    in_one_tick = Counter(now_s for now_s, _ in later)
    assert max(in_one_tick.values()) <= max(1, stations * TURN_S / 10.0)
