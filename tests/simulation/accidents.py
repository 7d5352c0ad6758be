"""What befalls a simulated site: a plan from a seed, in which accidents of many kinds overlap."""

import asyncio
import contextlib
import math
import random
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from disks import LyingDisk, backup_of, bring_back, flip_bits, misdirect

if TYPE_CHECKING:
    from simulated_site import Process, Site

BETWEEN_S = (172_800.0, 43_200.0, 14_400.0)
"""Mean time between two accidents of a kind, of which a seed has rolled one: rare to constant."""
IS_OFF = 0.5
"""Share of kinds that a seed has none of: what hides another is away at times."""
SHORTEST_S, LONGEST_S = 1.0, 7_200.0
AFTER_S = 60.0
"""Between the end of all accidents and the last sample."""
CLOCK_STEP_S = 3_600.0
REFUSED_S = 60.0
"""Within which one of two daemons of a name must have ended."""
SLOW_S = 20.0
"""How long a write waits for a slow disk."""

DAEMONS = ("gateway", "detector", "historian", "alarms")
KEEPERS = ("detector", "historian", "alarms")
"""What has a disk: all three on one machine."""

KINDS: Mapping[str, tuple[str, ...]] = {
    "kill": DAEMONS,
    "stop": DAEMONS,
    "stall": DAEMONS,
    "cut": DAEMONS,
    "mute": DAEMONS,
    "deaf": DAEMONS,
    "twin": KEEPERS,
    "backup": KEEPERS,
    "rot": KEEPERS,
    "misdirected": KEEPERS,
    "power": ("machine", "site"),
    "lie": ("machine",),
    "full": ("machine",),
    "slow": ("machine",),
    "plc": ("away", "silent", "refuses"),
    "clock": ("ahead", "back"),
    "clock-restart": ("ahead", "back"),
}


@dataclass(frozen=True)
class Accident:
    """One accident: what, to whom, from when on and how long [s], and the seed of what else chance decides."""

    kind: str
    target: str
    at_s: float
    lasts_s: float
    seed: int = 0


Plan = tuple[Accident, ...]


def plan_of(seed: int, seconds: float) -> Plan:
    """Accidents of a site that lives so long, in the order of their beginnings. The same seed has the same."""
    dice = random.Random(f"accidents {seed}")
    plan = []
    for kind, all_targets in KINDS.items():
        if dice.random() < IS_OFF:
            continue
        between_s, at_s = dice.choice(BETWEEN_S), 0.0
        targets = dice.sample(all_targets, dice.randint(1, len(all_targets)))  # some are spared for all of a life
        while (at_s := at_s + dice.expovariate(1.0 / between_s)) < seconds - AFTER_S:
            lasts_s = math.exp(dice.uniform(math.log(SHORTEST_S), math.log(LONGEST_S)))
            lasts_s = min(lasts_s, seconds - AFTER_S - at_s)
            plan.append(
                Accident(kind, dice.choice(targets), round(at_s, 1), round(lasts_s, 1), dice.randrange(10**6))
            )
    return tuple(sorted(plan, key=lambda accident: accident.at_s))


async def happen(site: "Site", plan: Plan) -> None:
    """Let all accidents of a plan happen, each at its time."""
    async with asyncio.TaskGroup() as group:
        for accident in plan:
            group.create_task(_one(site, accident), name=f"{accident.kind} {accident.target}")


async def _one(site: "Site", accident: Accident) -> None:
    await asyncio.sleep(accident.at_s)
    site.accidents.append(f"{accident.kind} {accident.target}")
    async with _ACTS[accident.kind](site, accident, random.Random(accident.seed)):
        await asyncio.sleep(accident.lasts_s)


@contextlib.asynccontextmanager
async def _kill(site: "Site", accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    names = {"site": DAEMONS, "machine": KEEPERS}.get(accident.target)
    processes = [site.processes[accident.target]] if names is None else _with_twins(site, names)
    for process in processes:
        await process.kill()
    yield
    for process in processes:
        process.start_again()


def _with_twins(site: "Site", names: Iterable[str]) -> "list[Process]":
    """All that ends with a machine."""
    return [*(site.processes[name] for name in names), *site.twins]


@contextlib.asynccontextmanager
async def _stop(site: "Site", accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    await site.processes[accident.target].stop()
    yield
    site.processes[accident.target].start_again()


@contextlib.asynccontextmanager
async def _stall(site: "Site", accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    process = site.processes[accident.target]
    with site.span("stalled", accident.target):
        process.stall()
        yield
        process.go_on()


@contextlib.asynccontextmanager
async def _cut(site: "Site", accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    is_mute, is_deaf = accident.kind != "deaf", accident.kind != "mute"
    site.processes[accident.target].cut(accident.lasts_s, is_mute=is_mute, is_deaf=is_deaf)
    with contextlib.ExitStack() as stack:
        for what, is_so in (("mute", is_mute), ("deaf", is_deaf)):
            if is_so:
                stack.enter_context(site.span(what, accident.target))
        yield


@contextlib.asynccontextmanager
async def _twin(site: "Site", accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    """A second daemon on the same folder: one of the two must end with a line of its own."""
    twin = site.twin_of(accident.target)
    site.twins.append(twin)
    twin.start_again()
    yield
    both_s = min(twin.lived_s, site.processes[accident.target].lived_s)
    if both_s > REFUSED_S:
        site.crashes.append(f"{accident.target}: two worked on one folder for {both_s:.0f} s")
    site.twins.remove(twin)
    await twin.kill()


@contextlib.asynccontextmanager
async def _backup(site: "Site", accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    """What was copied at the beginning is brought back at the end."""
    folder = site.folder_of(accident.target)
    copy = backup_of(folder)
    yield
    process = site.processes[accident.target]
    await process.kill()
    bring_back(copy, folder)
    site.harm("backup", accident.target)
    process.start_again()


@contextlib.asynccontextmanager
async def _damage(site: "Site", accident: Accident, dice: random.Random) -> AsyncIterator[None]:
    act = flip_bits if accident.kind == "rot" else misdirect
    process = site.processes[accident.target]
    is_away = dice.random() < 0.5  # what is read at a start only must be found then
    if is_away:
        await process.kill()
    file = act(site.folder_of(accident.target), dice)
    if file is not None:
        site.harm(accident.kind, accident.target)
    if is_away:
        process.start_again()
    yield


@contextlib.asynccontextmanager
async def _lie(site: "Site", _accident: Accident, dice: random.Random) -> AsyncIterator[None]:
    """The disks say that they have written what they have not; then the power fails."""
    disks = {name: LyingDisk(site.folder_of(name)) for name in KEEPERS}
    yield
    processes = _with_twins(site, KEEPERS)
    for process in processes:
        await process.kill()
    for name, disk in disks.items():
        if disk.lose(dice):
            site.harm("lie", name)
    await asyncio.sleep(dice.uniform(0.0, AFTER_S))
    for process in processes:
        process.start_again()


@contextlib.asynccontextmanager
async def _full(site: "Site", _accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    with site.span("full", "machine"):
        site.full += 1
        yield
        site.full -= 1


@contextlib.asynccontextmanager
async def _slow(site: "Site", _accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    with site.span("slow", "machine"):
        site.slow += 1
        yield
        site.slow -= 1


@contextlib.asynccontextmanager
async def _plc(site: "Site", accident: Accident, dice: random.Random) -> AsyncIterator[None]:
    plc = dice.choice(list(site.plcs.values()))
    plc.trouble = accident.target
    yield
    plc.trouble = ""


def _step_s(accident: Accident) -> float:
    return CLOCK_STEP_S if accident.target == "ahead" else -CLOCK_STEP_S


@contextlib.asynccontextmanager
async def _clock(site: "Site", accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    site.clock_s += _step_s(accident)
    yield
    site.clock_s -= _step_s(accident)


@contextlib.asynccontextmanager
async def _clock_restart(site: "Site", accident: Accident, dice: random.Random) -> AsyncIterator[None]:
    """The clock jumps while a daemon is away, and back while it is away again."""
    process = site.processes[dice.choice(DAEMONS)]
    for sign in (1.0, -1.0):
        await process.kill()
        await asyncio.sleep(dice.uniform(0.0, AFTER_S))
        site.clock_s += sign * _step_s(accident)
        process.start_again()
        if sign > 0.0:
            yield


_ACTS: Mapping[str, Callable[["Site", Accident, random.Random], contextlib.AbstractAsyncContextManager[None]]] = {
    "kill": _kill,
    "stop": _stop,
    "stall": _stall,
    "cut": _cut,
    "mute": _cut,
    "deaf": _cut,
    "twin": _twin,
    "backup": _backup,
    "rot": _damage,
    "misdirected": _damage,
    "power": _kill,
    "lie": _lie,
    "full": _full,
    "slow": _slow,
    "plc": _plc,
    "clock": _clock,
    "clock-restart": _clock_restart,
}
