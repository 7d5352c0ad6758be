"""Much alike work in several processes, with a progress bar on standard error."""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from wetwell.protocols.errors import WetwellError

Task = TypeVar("Task")
Result = TypeVar("Result")

_AHEAD = 4  # tasks in the queue for each worker


def work_through(
    work: Callable[[Task], Result], tasks: Iterable[Task], count: int, workers: int, description: str
) -> Iterator[Result]:
    """Yield the result of each task, in the order in which they get done.

    Parameters
    ----------
    work : callable
        Of one task; it, tasks and results are sent between processes, unless there is one worker only.
    tasks : iterable
    count : int
        Number of tasks, for the bar.
    workers : int
        >= 1.
    description : str
        Name of the bar.

    Raises
    ------
    WetwellError
        If a worker was killed; besides, whatever the work raises.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task(description, total=count)
        for result in map(work, tasks) if workers == 1 else _in_parallel(work, tasks, workers, description):
            progress.advance(bar)
            yield result


def _in_parallel(
    work: Callable[[Task], Result], tasks: Iterable[Task], workers: int, description: str
) -> Iterator[Result]:
    left = iter(tasks)
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"), initializer=_end_with_parent)
    try:
        waiting: set[Future[Result]] = set()
        while True:
            with _held_signals():  # the workers inherit it: Ctrl-C is this process's alone
                for task in islice(left, _AHEAD * workers - len(waiting)):
                    waiting.add(pool.submit(work, task))
            if not waiting:
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except BrokenProcessPool as error:
        raise WetwellError(f"a worker of the {description} was killed (out of memory?); run again") from error
    finally:
        pool.shutdown(cancel_futures=True)


def _end_with_parent() -> None:
    """End this worker when the process that started it is gone, even killed."""
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


@contextlib.contextmanager
def _held_signals() -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
