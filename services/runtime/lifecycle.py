"""What every daemon has: a way to stop, ticks that do not drift, and health figures on the bus."""

import asyncio
import contextlib
import itertools
import logging
import os
import signal
import sys
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping
from typing import Any

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import alive_key, status_key
from wetwell.protocols.messages.status import ServiceState, Status
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.health.board import BOARD
from wetwell.services.systemd.notify import watched_by_systemd

log = logging.getLogger(__name__)

TURN_S = 0.1
"""Many stations tell their health in turns of this length: to wake a process costs more than what it does. [s]"""
PARENT_VARIABLE = "WETWELL_STOP_WITH_PARENT"
"""Set for the children of a supervisor: they stop when their standard input ends, even if it was killed."""


@contextlib.asynccontextmanager
async def stop_event() -> AsyncIterator[asyncio.Event]:
    """Yield an event that SIGINT, SIGTERM or the end of the parent sets; a second signal acts as usual."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    signals = (signal.SIGINT, signal.SIGTERM)

    def request(sig: signal.Signals) -> None:
        log.info("stopping on %s", sig.name)
        stop.set()
        loop.remove_signal_handler(sig)

    def read_parent() -> None:
        if not os.read(sys.stdin.fileno(), 1024):
            loop.remove_reader(sys.stdin.fileno())
            log.info("stopping with the parent process")
            stop.set()

    has_parent = os.environ.get(PARENT_VARIABLE) == "1"
    for sig in signals:
        loop.add_signal_handler(sig, request, sig)
    if has_parent:
        loop.add_reader(sys.stdin.fileno(), read_parent)
    try:
        async with watched_by_systemd(stop):
            yield stop
    finally:
        for sig in signals:
            loop.remove_signal_handler(sig)
        if has_parent:
            loop.remove_reader(sys.stdin.fileno())


async def ticks(period_s: float) -> AsyncIterator[float]:
    """Yield the time since the start, in s, on each multiple of the period for ever; late ticks are skipped."""
    loop = asyncio.get_running_loop()
    start, n = loop.time(), 0
    while True:
        yield loop.time() - start
        n = max(n + 1, int((loop.time() - start) // period_s) + 1)
        await asyncio.sleep(start + n * period_s - loop.time())


async def until(stop: asyncio.Event, task: asyncio.Task[None]) -> None:
    """Wait until stopped or until the task ends; then cancel it. An error of the task is raised."""
    waiting = asyncio.create_task(stop.wait(), name="stop")
    try:
        await asyncio.wait({waiting, task}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for each in (waiting, task):
            each.cancel()
        await asyncio.gather(waiting, task, return_exceptions=True)
    if not task.cancelled() and (error := task.exception()) is not None:
        raise error


async def run_until_stopped(work: Coroutine[Any, Any, None], name: str) -> None:
    """Do the work of a daemon until it is stopped or the work ends; cancelled, it may still save what it holds."""
    async with stop_event() as stop:
        await until(stop, asyncio.create_task(work, name=name))


def _running() -> tuple[ServiceState, str]:
    return "running", ""


async def report_health(
    bus: Bus,
    station: str,
    service: str,
    period_s: float,
    figures: Callable[[], dict[str, float]],
    condition: Callable[[], tuple[ServiceState, str]] = _running,
    news: asyncio.Event | None = None,
) -> None:
    """Show that a service lives; publish its figures, its state and the reason for ever, also for `/metrics`.

    That is once a period, and at once where `news` is set.
    """
    tell = _teller(bus, station, service, period_s, figures, condition)
    async with asyncio.TaskGroup() as group:
        if news is not None:
            group.create_task(_at_news(news, tell), name=f"{service}.news")
        async for _ in ticks(period_s):
            tell()


async def report_health_in_turn(
    bus: Bus, service: str, period_s: float, figures: Mapping[str, Callable[[], dict[str, float]]]
) -> None:
    """Do as `report_health` for a service of many stations: of all at once, and then of some in each turn.

    Parameters
    ----------
    figures : mapping of str to callable
        Of each station.
    """
    tellers = [_teller(bus, station, service, period_s, each) for station, each in figures.items()]
    turns = max(1, min(len(tellers), int(period_s / TURN_S)))
    due, turn = tellers, itertools.cycle(range(turns))
    async for _ in ticks(period_s / turns):
        for tell in due:
            tell()
        due = tellers[next(turn) :: turns]


def _teller(
    bus: Bus,
    station: str,
    service: str,
    period_s: float,
    figures: Callable[[], dict[str, float]],
    condition: Callable[[], tuple[ServiceState, str]] = _running,
) -> Callable[[], None]:
    """What tells the figures of a service once; its presence is announced."""
    bus.announce(alive_key(station, service))
    publisher = bus.publisher(status_key(station, service))

    def tell() -> None:
        state, reason = condition()
        status = Status(
            time=now_ns(), station=station, service=service, state=state, figures=figures(), reason=reason
        )
        BOARD.report(station, service, period_s, status.figures)
        publisher.put(status.encode())

    return tell


async def _at_news(news: asyncio.Event, tell: Callable[[], None]) -> None:
    while await news.wait():
        news.clear()
        tell()
