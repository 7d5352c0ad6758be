"""What each kind of accident does to a simulated site."""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from accidents import AFTER_S, CLOCK_STEP_S, DAEMONS, KEEPERS, Accident, Plan
from disks import LyingDisk, backup_of, bring_back, clear, flip_bits, lose_write, misdirect

if TYPE_CHECKING:
    from simulated_site import Process, Site

REFUSED_S = 60.0
"""Within which one of two daemons of a name must have ended."""


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
    copy = backup_of(site.folder_of(accident.target))
    yield
    process = site.processes[accident.target]
    await process.kill()
    site.harm("backup", accident.target, lambda folder: bring_back(copy, folder))
    process.start_again()


@contextlib.asynccontextmanager
async def _damage(site: "Site", accident: Accident, dice: random.Random) -> AsyncIterator[None]:
    act = {"rot": flip_bits, "misdirected": misdirect, "hole": clear}[accident.kind]
    async with _harmed(site, accident, dice, act):
        yield


@contextlib.asynccontextmanager
async def _stale(site: "Site", accident: Accident, dice: random.Random) -> AsyncIterator[None]:
    """Something that was written meanwhile is not there at the end."""
    copy = backup_of(site.folder_of(accident.target))
    yield
    async with _harmed(site, accident, dice, partial(lose_write, copy)):
        pass


@contextlib.asynccontextmanager
async def _harmed(
    site: "Site", accident: Accident, dice: random.Random, act: Callable[[Path, random.Random], Path | None]
) -> AsyncIterator[None]:
    """Something is done to the files of a daemon that is away, or that begins again some time later, or lives on."""
    process = site.processes[accident.target]
    fate = dice.choice(("away", "away", "again", "lives"))
    if fate == "away":  # what is read at a start only must be found then
        await process.kill()
    site.harm(accident.kind, accident.target, lambda folder: act(folder, dice) is not None)
    if fate == "away":
        process.start_again()
    yield
    if fate == "again":
        await process.kill()
        process.start_again()


@contextlib.asynccontextmanager
async def _lie(site: "Site", _accident: Accident, dice: random.Random) -> AsyncIterator[None]:
    """The disks say that they have written what they have not; then the power fails."""
    disks = {name: LyingDisk(site.folder_of(name)) for name in KEEPERS}
    yield
    processes = _with_twins(site, KEEPERS)
    for process in processes:
        await process.kill()
    for name, disk in disks.items():
        site.harm("lie", name, lambda _, disk=disk: disk.lose(dice))
    await asyncio.sleep(dice.uniform(0.0, AFTER_S))
    for process in processes:
        process.start_again()


@contextlib.asynccontextmanager
async def _strain(site: "Site", accident: Accident, _dice: random.Random) -> AsyncIterator[None]:
    """The disk of the machine is full, or slow."""
    with site.span(accident.kind, "machine"):
        site.strains[accident.kind] += 1
        yield
        site.strains[accident.kind] -= 1


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
    "hole": _damage,
    "stale": _stale,
    "power": _kill,
    "lie": _lie,
    "full": _strain,
    "slow": _strain,
    "plc": _plc,
    "clock": _clock,
    "clock-restart": _clock_restart,
}
