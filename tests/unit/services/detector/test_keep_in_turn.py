"""States that processes keep which live one after another, each shorter than it takes to keep all."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from types import SimpleNamespace

import pytest
from virtual_loop import run_virtual

from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.detector.daemon import keep_in_turn

PERIOD_S = 60.0


@dataclass(frozen=True, eq=False)
class Judge:
    detector: SimpleNamespace
    keep_aside: Callable[[], Awaitable[None]]


def oldest_s(stations, life_s, behind_s, lives):
    """How old the oldest state gets that a life begins with, after the first rounds of all. [s]"""
    kept_s = dict.fromkeys(range(stations), 0.0)
    ages = []

    async def live():
        clock = asyncio.get_running_loop().time
        begun_s = clock()
        ages.append(begun_s - min(kept_s.values()))

        def judge(number):
            async def keep_aside():
                kept_s[number] = clock()

            seen = SimpleNamespace(seen_until_ns=round(kept_s[number] * NS_PER_S))
            return Judge(seen, keep_aside)

        intake = SimpleNamespace(is_behind=lambda _: clock() < begun_s + behind_s)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(life_s):
                await keep_in_turn([judge(number) for number in range(stations)], intake, PERIOD_S)

    async def live_on():
        for _ in range(lives):
            await live()

    run_virtual(live_on())
    return max(ages)


@pytest.mark.parametrize(
    ("stations", "life_s", "behind_s"),
    [(1, 7.0, 0.0), (1, 7.0, 6.0), (6, 13.0, 1.0), (40, 5.0, 0.3), (6, 500.0, 1.0)],
)
def test_no_state_gets_older_than_two_periods_however_short_its_processes_live(stations, life_s, behind_s):
    assert oldest_s(stations, life_s, behind_s, lives=60) <= 2.0 * PERIOD_S


def test_a_station_that_stays_behind_keeps_no_other_from_its_turn():
    kept = []

    def judge(number):
        async def keep_aside():
            kept.append(number)

        return Judge(SimpleNamespace(seen_until_ns=number), keep_aside)

    async def run():
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(2.0 * PERIOD_S - 1.0):
                intake = SimpleNamespace(is_behind=lambda one: one.detector.seen_until_ns == 0)
                await keep_in_turn([judge(number) for number in range(3)], intake, PERIOD_S)

    run_virtual(run())
    assert kept == [1, 2, 1, 2, 1, 2]
