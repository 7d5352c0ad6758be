"""A disk is slow for all who work while it is, and for nobody afterwards."""

import asyncio

import pytest
from accidents import SLOW_S, Accident
from network import SimulatedBus
from rules import broken_rules
from simulated_site import Site
from site_kinds import light_site

BEGIN_S, LASTS_S = 1_050.0, 1_000.0
SLOW = Accident("slow", "machine", BEGIN_S, LASTS_S)


@pytest.mark.parametrize(
    "plan", [(SLOW,), (SLOW, Accident("kill", "alarms", 1_500.0, 1.0))], ids=["begun before", "begun meanwhile"]
)
def test_a_daemon_waits_for_a_slow_disk_as_long_as_it_is_slow(folder, plan, monkeypatch):
    waits_s: dict[float, float] = {}

    async def write_often(_site: Site, _bus: SimulatedBus) -> None:
        now_s = asyncio.get_running_loop().time
        while True:
            begin_s = now_s()
            await asyncio.to_thread(int)
            waits_s[begin_s] = now_s() - begin_s
            await asyncio.sleep(100.0)

    monkeypatch.setattr(Site, "_alarm", write_often)
    light_site(1, 1, 0.05, 300, folder, plan)
    slow_s = [waits_s.pop(begin_s) for begin_s in list(waits_s) if BEGIN_S <= begin_s < BEGIN_S + LASTS_S]
    assert set(slow_s) == {SLOW_S}
    assert set(waits_s.values()) == {0.0}


def test_seed_2707465_asks_a_historian_that_began_while_its_disk_was_slow(folder):
    plan = (
        Accident("kill", "detector", 39_422.3, 1.0),
        Accident("slow", "machine", 43_956.7, 3_501.0),
        Accident("kill", "historian", 45_094.4, 1.0),
        Accident("kill", "detector", 54_373.1, 1.0),
    )
    assert broken_rules(light_site(2707465, 1, 2.0, 300, folder, plan)) == []
