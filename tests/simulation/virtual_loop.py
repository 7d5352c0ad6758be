"""An event loop whose clock jumps: hours of waiting cost nothing, and a seed gives the same events each time."""

import asyncio
import heapq
import itertools
import math
import selectors
from collections import deque
from collections.abc import Callable, Coroutine
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any


@dataclass(eq=False)
class Life:
    """One life of a simulated process: all that runs in its context.

    Attributes
    ----------
    is_stalled : bool
        Whether it stands, as after SIGSTOP: what is due waits in `held`.
    is_dead : bool
        Whether it was killed: nothing that it writes reaches a disk any more.
    disk_s : callable
        How long its threads wait for a disk now. [s]
    """

    name: str
    is_stalled: bool = False
    is_dead: bool = False
    disk_s: Callable[[], float] = float
    held: list[asyncio.Handle] = field(default_factory=list)

    def go_on(self) -> None:
        """End a stall: what was due meanwhile is done, in its order."""
        self.is_stalled = False
        asyncio.get_running_loop()._ready.extend(self.held)  # type: ignore[attr-defined]
        self.held.clear()


LIFE: ContextVar[Life | None] = ContextVar("life", default=None)
"""Of the process whose code runs."""


class _NoWait(selectors.SelectSelector):
    """Looks for files that are ready, but never waits: the loop's clock moves on instead."""

    def __init__(self, clock: list[float], grain_s: float) -> None:
        super().__init__()
        self._clock = clock
        self._grain_s = grain_s

    def select(self, timeout: float | None = None) -> list[Any]:
        if timeout is None:
            raise RuntimeError("deadlock: every task waits for something that cannot come")
        now_s = self._clock[0] + timeout
        self._clock[0] = math.ceil(now_s / self._grain_s) * self._grain_s if self._grain_s else now_s
        return []


class _Ready(deque[asyncio.Handle]):
    """What is due; of a process that stands it is held."""

    def __init__(self, nothing: asyncio.Handle) -> None:
        super().__init__()
        self._nothing = nothing

    def popleft(self) -> asyncio.Handle:
        handle = super().popleft()
        life = handle._context.get(LIFE)  # type: ignore[attr-defined]
        if life is None or not life.is_stalled:
            return handle
        life.held.append(handle)
        return self._nothing


class _Timer(asyncio.TimerHandle):
    """Of those that are due at the same time the one that was made first comes first, whatever else waits."""

    def __init__(self, number: int, *args: Any) -> None:
        super().__init__(*args)
        self._number = number

    def __lt__(self, other: "_Timer") -> bool:
        return (self._when, self._number) < (other._when, other._number)


class VirtualLoop(asyncio.SelectorEventLoop):
    """Loop on a virtual clock that begins at 0 s. No threads and no sockets: nothing wakes it from outside.

    With a grain it wakes at its multiples only, as on a busy machine: what is due since then comes at once, in order.
    """

    def __init__(self, grain_s: float = 0.0) -> None:
        self._clock = [0.0]
        super().__init__(_NoWait(self._clock, grain_s))
        nothing = asyncio.Handle(lambda: None, (), self)
        nothing.cancel()
        self._ready = _Ready(nothing)
        self._numbers = itertools.count()

    def time(self) -> float:
        """Virtual time. [s]"""
        return self._clock[0]

    def call_at(self, when: float, callback: Any, *args: Any, context: Any = None) -> asyncio.TimerHandle:
        """A timer that comes in its turn."""
        timer = _Timer(next(self._numbers), when, callback, args, self, context)
        heapq.heappush(self._scheduled, timer)
        timer._scheduled = True
        return timer

    def call_soon_threadsafe(self, callback: Any, *args: Any, context: Any = None) -> asyncio.Handle:
        """All is in one thread."""
        return self.call_soon(callback, *args, context=context)

    def run_in_executor(self, _executor: Any, func: Any, *args: Any) -> asyncio.Future[Any]:
        """Done in this thread: at once, or when the disk of a simulated process has let it wait."""
        future = self.create_future()
        life = LIFE.get()
        disk_s = 0.0 if life is None else life.disk_s()
        if disk_s:
            self.call_later(disk_s, _work, future, func, args)
        else:
            _work(future, func, args)
        return future


def _work(future: asyncio.Future[Any], func: Any, args: tuple[Any, ...]) -> None:
    if future.cancelled():
        return
    try:
        future.set_result(func(*args))
    except Exception as error:  # noqa: BLE001 -- as an executor does
        future.set_exception(error)


def run_virtual(main: Coroutine[Any, Any, Any], grain_s: float = 0.0) -> Any:
    """Result of a coroutine on a virtual clock."""
    with asyncio.Runner(loop_factory=lambda: VirtualLoop(grain_s)) as runner:
        return runner.run(main)
