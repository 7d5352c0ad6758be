"""What befalls a simulated site, one accident after the other, each over before the next."""

import asyncio
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simulated_site import Site

BETWEEN_S = 10_000.0
"""Mean time between two accidents."""
LASTS_S, LASTS_POLLS = 1_000.0, 17.0
"""An accident lasts at most so long, or so many polls where that is longer."""
CLOCK_STEP_S = 3_600.0
CLOCK_LASTS_S = 7_200.0
AFTER_S = 60.0

ACCIDENTS = (
    "kill gateway",
    "kill detector",
    "kill historian",
    "kill alarms",
    "cut gateway",
    "cut detector",
    "cut historian",
    "cut alarms",
    "disk full",
    "plc away",
    "plc silent",
    "plc refuses",
    "clock ahead",
    "clock back",
)


async def happen(site: "Site") -> None:
    """Let accidents happen, as the dice of the site fall, until the last one would not be over in time."""
    longest_s = max(CLOCK_LASTS_S, _longest_s(site)) + AFTER_S
    while True:
        wait_s = site.dice.expovariate(1.0 / BETWEEN_S)
        if asyncio.get_running_loop().time() + wait_s + longest_s > site.seconds:
            return
        await asyncio.sleep(wait_s)
        accident = site.dice.choice(ACCIDENTS)
        site.accidents.append(accident)
        await _happen(site, *accident.split())
        await asyncio.sleep(AFTER_S)


def _longest_s(site: "Site") -> float:
    return max(LASTS_S, LASTS_POLLS * site.period_s)


async def _happen(site: "Site", kind: str, name: str) -> None:
    lasts_s = site.dice.uniform(0.0, _longest_s(site))
    match kind:
        case "kill":
            await site.processes[name].kill()
            await asyncio.sleep(lasts_s)
            site.processes[name].start(site.network)
        case "cut":
            bus = site.processes[name].bus
            assert bus is not None
            bus.cut(lasts_s)
            await asyncio.sleep(lasts_s)
        case "disk":
            site.is_disk_full = True
            await asyncio.sleep(lasts_s)
            site.is_disk_full = False
        case "plc":
            plc = site.dice.choice(list(site.plcs.values()))
            plc.trouble = name
            await asyncio.sleep(lasts_s)
            plc.trouble = ""
        case "clock":
            site.clock_s = CLOCK_STEP_S if name == "ahead" else -CLOCK_STEP_S
            await asyncio.sleep(site.dice.uniform(0.0, CLOCK_LASTS_S))
            site.clock_s = 0.0
