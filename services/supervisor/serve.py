"""Router and children of `wetwell up`: started, waited for, shown, stopped."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from wetwell.protocols.bus.interface import Bus, Presence, Subscription
from wetwell.protocols.bus.keys import SITE, alive_key, status_key, verdict_key
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.plant_clock import PlantClock
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.runtime.connection import listen
from wetwell.services.runtime.health.board import BOARD, HealthBoard
from wetwell.services.runtime.lifecycle import stop_event, until
from wetwell.services.runtime.settings import Settings
from wetwell.services.supervisor.children import child, watch
from wetwell.services.supervisor.keyboard import keyboard
from wetwell.services.supervisor.plant_control import KEYS, PlantControl
from wetwell.services.supervisor.story import Story

log = logging.getLogger(__name__)

OF_STATION = frozenset({"detector", "simulator"})
"""Parts that show themselves under the station's name; the others serve the whole site."""
SLOWED_S = 4.0
"""So long on the wall the plant runs slowly after a change of state: one reads the line and looks at the page."""


class Screen(Protocol):
    """Where `wetwell up` says what happens."""

    def greet(self) -> None:
        """The router listens, and Ctrl-C is heard."""

    def show_ready(self, part: str, after_s: float) -> None:
        """A part is ready; the plant waits for the others."""

    def show_begin(self, *, has_keys: bool) -> None:
        """All are ready, and the plant begins."""

    def show_verdict(self, verdict: Verdict) -> None:
        """A verdict has come."""

    def show_clock(self, clock: PlantClock) -> None:
        """The clock of the plant was set."""

    def show_story(self, story: Story, *, is_told: bool) -> None:
        """What was seen, at the end; or where the scenario `is_told` and the plant stands."""


@dataclass(frozen=True)
class UpPlan:
    """What `wetwell up` runs.

    Attributes
    ----------
    station : str
        Name whose verdicts are shown, and whose plant is started when all are ready.
    commands : dict
        Arguments of `wetwell` for each child, by its name.
    is_shown : bool
        Whether the plant runs slowly for a moment at each change of state.
    story_s : float
        Length of the scenario, at whose end the plant stands if it does. [s]
    limit_s : float, optional
        Time after which all is stopped. [s]
    """

    station: str
    commands: Mapping[str, Sequence[str]]
    is_shown: bool = False
    story_s: float = float("inf")
    limit_s: float | None = None


async def serve_all(settings: Settings, plan: UpPlan, screen: Screen) -> None:
    """Run router and children until stopped, until the time is over, or until a child ends.

    Raises
    ------
    LinkError
        If the router's endpoint cannot be opened.
    ChildError
        If a child ends before it was asked to.
    """
    story = Story()
    async with stop_event() as stop:
        with listen(settings) as bus:
            screen.greet()
            running = asyncio.create_task(_run(settings, bus, plan, screen, story, stop), name="up.run")
            if plan.limit_s is not None:
                asyncio.get_running_loop().call_later(plan.limit_s, stop.set)
            try:
                await until(stop, running)
            finally:
                screen.show_story(story, is_told=False)


async def _run(settings: Settings, bus: Bus, plan: UpPlan, screen: Screen, story: Story, stop: asyncio.Event) -> None:
    verdicts = bus.subscribe(verdict_key(plan.station))
    statuses = bus.subscribe(status_key("*", "*"))
    presences = bus.watch(alive_key("*", "*"))
    control = PlantControl(bus, plan.station)
    async with contextlib.AsyncExitStack() as stack:
        children = {
            name: await stack.enter_async_context(child(settings, name, arguments))
            for name, arguments in plan.commands.items()
        }
        keys = await stack.enter_async_context(keyboard())
        async with asyncio.TaskGroup() as group:
            for name, process in children.items():
                group.create_task(watch(name, process), name=f"up.{name}")
            teller = _Teller(plan, screen, story, control, group)
            group.create_task(
                show_health(statuses, BOARD, settings.health.period_s, teller.note_end), name="up.health"
            )
            await _wait_for_all(presences, plan, screen)
            screen.show_begin(has_keys=keys is not None)
            group.create_task(
                teller.show_verdicts(verdicts), name="up.verdicts"
            )  # a kept detector tells its last before
            await control.release()
            teller.has_begun = True
            if keys is not None:
                group.create_task(_obey(keys, control, screen, stop), name="up.keys")


async def _wait_for_all(presences: Subscription[Presence], plan: UpPlan, screen: Screen) -> None:
    """Wait until all parts show themselves, which they do when they listen and their kernels are loaded."""
    begun_s = time.monotonic()
    missing = {alive_key(plan.station if part in OF_STATION else SITE, part): part for part in plan.commands}
    while missing:
        for presence in await presences.receive():
            if presence.is_alive and (part := missing.pop(presence.key, None)):
                screen.show_ready(part, time.monotonic() - begun_s)


async def _obey(keys: asyncio.Queue[str], control: PlantControl, screen: Screen, stop: asyncio.Event) -> None:
    while True:
        key = await keys.get()
        if key == "q":
            stop.set()
        elif key in KEYS:
            try:
                screen.show_clock(await KEYS[key](control))
            except MessageError as error:  # anybody may answer on the bus
                log.warning("%s", error)


class _Teller:
    """Says on the screen what comes over the bus."""

    def __init__(
        self, plan: UpPlan, screen: Screen, story: Story, control: PlantControl, group: asyncio.TaskGroup
    ) -> None:
        self._plan = plan
        self._screen = screen
        self._story = story
        self._control = control
        self._group = group
        self.has_begun = False
        self._is_told = False

    async def show_verdicts(self, verdicts: Subscription[bytes]) -> None:
        """Show verdicts for ever."""
        while True:
            for payload in await verdicts.receive():
                try:
                    verdict = Verdict.decode(payload)
                except MessageError as error:  # anybody may publish on the bus
                    log.warning("%s", error)
                    continue
                if self._story.handle(verdict) and self._plan.is_shown:
                    self._group.create_task(self._look(), name="up.look")
                self._screen.show_verdict(verdict)

    async def _look(self) -> None:
        try:
            await self._control.look(SLOWED_S)
        except MessageError as error:
            log.warning("%s", error)

    def note_end(self, status: Status) -> None:
        """Say what was seen when the plant stands at the end of its scenario."""
        if (status.station, status.service) != (self._plan.station, "simulator"):
            return
        figures = status.figures
        is_over = figures.get("held", 0.0) > 0.0 and figures.get("seconds", 0.0) >= self._plan.story_s
        if is_over and self.has_begun and not self._is_told:
            self._is_told = True
            self._screen.show_story(self._story, is_told=True)


async def show_health(
    statuses: Subscription[bytes], board: HealthBoard, period_s: float, note: Callable[[Status], None]
) -> None:
    """Put the figures of all services behind the health page of this process, for ever, and have them noted."""
    while True:
        for payload in await statuses.receive():
            try:
                status = Status.decode(payload)
            except MessageError as error:
                log.warning("%s", error)
                continue
            board.report(status.station, status.service, period_s, status.figures)
            note(status)
