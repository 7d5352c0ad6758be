"""An event loop whose clock jumps: hours of waiting cost nothing, and a seed gives the same events each time."""

import asyncio
import math
import selectors
from collections.abc import Coroutine
from typing import Any


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


class VirtualLoop(asyncio.SelectorEventLoop):
    """Loop on a virtual clock that begins at 0 s. No threads and no sockets: nothing wakes it from outside.

    With a grain it wakes at its multiples only, as on a busy machine: what is due since then comes at once, in order.
    """

    def __init__(self, grain_s: float = 0.0) -> None:
        self._clock = [0.0]
        super().__init__(_NoWait(self._clock, grain_s))

    def time(self) -> float:
        """Virtual time. [s]"""
        return self._clock[0]

    def call_soon_threadsafe(self, callback: Any, *args: Any, context: Any = None) -> asyncio.Handle:
        """All is in one thread."""
        return self.call_soon(callback, *args, context=context)

    def run_in_executor(self, _executor: Any, func: Any, *args: Any) -> asyncio.Future[Any]:
        """Done at once, in this thread: what a thread would do takes no virtual time."""
        future = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:  # noqa: BLE001 -- as an executor does
            future.set_exception(error)
        return future


def run_virtual(main: Coroutine[Any, Any, Any], grain_s: float = 0.0) -> Any:
    """Result of a coroutine on a virtual clock."""
    with asyncio.Runner(loop_factory=lambda: VirtualLoop(grain_s)) as runner:
        return runner.run(main)
