"""sd_notify: READY, WATCHDOG and STOPPING over the datagram socket that systemd names; without one nothing."""

import asyncio
import contextlib
import logging
import os
import socket
from collections.abc import AsyncIterator

log = logging.getLogger(__name__)


def notify(state: str) -> None:
    """Send a line such as `READY=1` to systemd."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            sender.sendto(state.encode(), "\0" + address[1:] if address.startswith("@") else address)
    except OSError as error:
        log.warning("NOTIFY_SOCKET %s: %s", address, error.strerror or error)


@contextlib.asynccontextmanager
async def watched_by_systemd(stop: asyncio.Event) -> AsyncIterator[None]:
    """Say READY, feed the watchdog at half of its time from the event loop, and say STOPPING once `stop` is set."""
    notify("READY=1")
    period_us = int(os.environ.get("WATCHDOG_USEC", "0"))
    tasks = [asyncio.create_task(_tell_stop(stop), name="systemd.stop")]
    if period_us > 0:
        tasks.append(asyncio.create_task(_feed(period_us / 2e6), name="systemd.watchdog"))
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()


async def _tell_stop(stop: asyncio.Event) -> None:
    await stop.wait()
    notify("STOPPING=1")


async def _feed(period_s: float) -> None:
    while True:
        notify("WATCHDOG=1")
        await asyncio.sleep(period_s)
