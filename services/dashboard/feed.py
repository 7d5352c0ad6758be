"""From the bus to the browsers: payloads into the site's state, its frames into the event streams."""

import asyncio
import logging
from collections.abc import Callable
from typing import TypeVar

from wetwell.protocols.bus.interface import Bus, Subscription
from wetwell.protocols.bus.keys import (
    alarm_key,
    alive_key,
    gap_key,
    model_key,
    sample_block_key,
    sample_key,
    status_key,
    verdict_key,
)
from wetwell.services.dashboard.event_streams import EventStreams
from wetwell.services.dashboard.past.backfill import ChartBackfill
from wetwell.services.dashboard.view.site_view import SiteView
from wetwell.services.runtime.lifecycle import ticks

log = logging.getLogger(__name__)

FRAME_S = 0.25
FETCH_S = FRAME_S / 5.0
FRAMES_A_SECOND = 4
SHOWN_VERDICTS = 60
FIRST_S = 2.0
SAMPLES = 20_000
"""Messages that wait to be shown; the newest count, and others are told as lost on the way to the page."""

T = TypeVar("T")


class Feed:
    """Keeps a `SiteView` up to date from the bus and sends what is new to the browsers.

    Parameters
    ----------
    bus : Bus
    view : SiteView
    streams : EventStreams
    """

    def __init__(self, bus: Bus, view: SiteView, streams: EventStreams) -> None:
        self._view = view
        self._streams = streams
        self._bus = bus
        self._backfill = ChartBackfill(bus, view, streams)
        keys = [sample_key("*"), sample_block_key("*")]
        self._samples = bus.collect(keys, capacity=SAMPLES, recover=False, pace_s=FETCH_S)
        self._messages: list[tuple[Subscription[bytes], Callable[[bytes], None]]] = [
            (bus.subscribe(verdict_key("*"), history=SHOWN_VERDICTS, pace_s=FETCH_S), view.handle_verdict),
            (bus.subscribe(model_key("*"), history=1, pace_s=FETCH_S), view.handle_model),
            (bus.subscribe(alarm_key("*"), history=1, pace_s=FETCH_S), view.handle_alarm),
            (bus.subscribe(gap_key("*"), history=1, pace_s=FETCH_S), view.handle_gap),
            (bus.subscribe(status_key("*", "*"), history=1, pace_s=FETCH_S), view.handle_status),
        ]
        self._presence = bus.watch(alive_key("*", "*"))

    async def run(self) -> None:
        """Take and send for ever, from the last sample of each station on."""
        samples, blocks = await asyncio.gather(
            self._bus.ask(sample_key("*"), timeout_s=FIRST_S), self._bus.ask(sample_block_key("*"), timeout_s=FIRST_S)
        )
        for payload in samples:
            self._view.handle_sample(payload, is_kept=True)
        for payload in blocks:
            self._view.handle_sample_block(payload, is_kept=True)
        async with asyncio.TaskGroup() as group:
            for subscription, handle in self._messages:
                group.create_task(_each(subscription, handle))
            group.create_task(self._show_samples())
            group.create_task(_each(self._presence, self._view.handle_presence))
            group.create_task(self._send(group))

    async def _show_samples(self) -> None:
        """Give each station what has come of it since the last time: so only what is drawn has to be decoded."""
        while True:
            batches: dict[str, list[bytes]] = {}
            for key, payload in await self._samples.receive():
                batches.setdefault(key, []).append(payload)
            for key, payloads in batches.items():
                if key.endswith("/sample"):
                    self._view.handle_samples(payloads)
                else:
                    for payload in payloads:
                        self._view.handle_sample_block(payload)
            await asyncio.sleep(FRAME_S / 2.0)

    async def _send(self, group: asyncio.TaskGroup) -> None:
        number = 0
        loop = asyncio.get_running_loop()
        async for _ in ticks(FRAME_S):
            for name, frame in self._view.advance(loop.time()).items():
                self._streams.send(name, frame)
            for name in self._backfill.wanted(loop.time()):
                group.create_task(self._backfill.fill(name), name=f"dashboard.past.{name}")
            number += 1
            if number % FRAMES_A_SECOND == 0:
                frame_or_none = self._view.site_frame()
                if frame_or_none is not None:
                    self._streams.send("", frame_or_none)

    def figures(self) -> dict[str, float]:
        """Health figures."""
        return {
            "stations": float(len(self._view.stations)),
            "clients": float(self._streams.clients),
            "malformed": float(self._view.counts["malformed"]),
            "dropped": float(self._samples.dropped + sum(heard.dropped for heard, _ in self._messages)),
            "missed": float(self._samples.missed + sum(heard.missed for heard, _ in self._messages)),
        }


async def _each(subscription: Subscription[T], handle: Callable[[T], None]) -> None:
    """Take in batches: to wake the loop for every message costs more than the message."""
    while True:
        for item in await subscription.receive():
            handle(item)
        await asyncio.sleep(FRAME_S / 2.0)
