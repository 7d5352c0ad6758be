"""Where jobs are done: processes of this machine, or the workers of a Dask scheduler."""

import contextlib
import multiprocessing
import os
import re
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import Any

from wetwell.protocols.errors import ConfigError, LinkError

LOCAL = "local"
ADDRESS = re.compile(r"(tcp|tls)://.+:\d+")
CONNECT_S = 10.0
WORKERS_S = 30.0
"""How long a scheduler without any worker is waited for."""

Pool = tuple[Executor, Callable[[], int]]
"""Takes jobs, and how many it can do at once now."""


def check_scheduler(scheduler: str | None) -> None:
    """Refuse a scheduler that cannot be one, before any work.

    Raises
    ------
    ConfigError
        If it is neither an address nor `local`, or Dask is not installed.
    """
    if scheduler is None:
        return
    if scheduler != LOCAL and not ADDRESS.fullmatch(scheduler):
        raise ConfigError(f"--scheduler: got '{scheduler}', must be tcp://HOST:PORT, tls://HOST:PORT or local")
    try:
        import distributed  # noqa: F401, PLC0415 - an extra
    except ImportError as error:
        raise ConfigError(f"--scheduler: needs the extra 'fleet' (pip install '.[fleet]'): {error}") from error


@contextlib.contextmanager
def pool_of(workers: int, scheduler: str | None) -> Iterator[Pool]:
    """Pool of `workers` processes here, of as many workers of Dask here (`local`), or of those of a scheduler.

    Raises
    ------
    LinkError
        If no scheduler answers at the address, or it has no worker.
    """
    if scheduler is None:
        pool = ProcessPoolExecutor(
            workers, mp_context=multiprocessing.get_context("spawn"), initializer=_end_with_parent
        )
        try:
            yield pool, lambda: workers
        finally:
            pool.shutdown(cancel_futures=True)
    else:
        with _dask(workers, scheduler) as pool_and_size:
            yield pool_and_size


@contextlib.contextmanager
def _dask(workers: int, scheduler: str) -> Iterator[Pool]:
    from distributed import Client, LocalCluster  # noqa: PLC0415 - an extra, and slow to load

    with contextlib.ExitStack() as stack:
        address: Any = scheduler
        if scheduler == LOCAL:
            with held_interrupts():
                address = stack.enter_context(
                    LocalCluster(n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address=None)
                )
        try:
            client = stack.enter_context(Client(address, timeout=CONNECT_S, set_as_default=False))
        except (OSError, TimeoutError) as error:
            raise LinkError(f"--scheduler: no scheduler answers at {scheduler}") from error
        try:
            client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError as error:
            raise LinkError(f"--scheduler: {scheduler} has no worker") from error
        executor = client.get_executor(pure=False)
        try:
            yield executor, lambda: sum(client.nthreads().values())
        finally:
            executor.shutdown(wait=False)


@contextlib.contextmanager
def noted_interrupts() -> Iterator[Callable[[], bool]]:
    """Note Ctrl-C instead of raising it wherever the program is, such as within the locks of a pool.

    Yields
    ------
    is_interrupted : callable
        Whether there was one. Outside of the main thread signals are as they were, and none is noted.
    """
    noted: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    before = signal.signal(signal.SIGINT, lambda number, _: noted.append(number))
    try:
        yield lambda: bool(noted)
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def held_interrupts() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach: it is this process's alone."""
    with _masked(signal.SIG_BLOCK):
        yield


@contextlib.contextmanager
def let_interrupts() -> Iterator[None]:
    """Start a program, from a worker that Ctrl-C does not reach, that it does reach."""
    with _masked(signal.SIG_UNBLOCK):
        yield


@contextlib.contextmanager
def _masked(how: int) -> Iterator[None]:
    before = signal.pthread_sigmask(how, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent() -> None:
    """End this worker when the process that started it is gone, even killed."""
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
