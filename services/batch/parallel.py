"""Much alike work in several processes, here or on a scheduler, with a progress bar on standard error."""

import logging
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from wetwell.protocols.errors import LinkError, WetwellError
from wetwell.services.batch.executors import held_interrupts, noted_interrupts, pool_of

log = logging.getLogger(__name__)

Task = TypeVar("Task")
Result = TypeVar("Result")

_AHEAD = 4  # tasks in the queue for each worker
WATCH_S = 0.5
"""How often Ctrl-C is looked for while nothing gets done."""


@dataclass(frozen=True, slots=True)
class Failure:
    """What stands in place of the result of a task that failed: one line."""

    error: str


def work_through(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    count: int,
    workers: int,
    description: str,
    scheduler: str | None = None,
) -> Iterator[tuple[int, Result | Failure]]:
    """Yield number (from 0) and result of each task, in the order in which they get done.

    A task that raises, or kills its process, gives a `Failure`; the others go on.

    Parameters
    ----------
    work : callable
        Of one task; it, tasks and results are sent between processes, unless there is one worker only, here.
    tasks : iterable
    count : int
        Number of tasks, for the bar.
    workers : int
        >= 1; the workers of a scheduler count themselves.
    description : str
        Name of the bar.
    scheduler : str, optional
        Address of a Dask scheduler, or `local` for one that is started here.

    Raises
    ------
    LinkError
        If the scheduler does not answer, has no worker, or goes away.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    attempt = partial(_attempt, work)
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task(description, total=count)
        done: Iterator[tuple[int, Result | Failure]]
        if count == 0 or (workers == 1 and scheduler is None):
            done = enumerate(map(attempt, tasks))
        else:
            done = _in_parallel(attempt, tasks, workers, scheduler)
        for result in done:
            progress.advance(bar)
            yield result


def refuse_if_all(failures: Sequence[Failure], count: int) -> None:
    """Say what the first failure says, if there is nothing but failures.

    Raises
    ------
    WetwellError
        With one line.
    """
    if failures and len(failures) == count:
        more = f" (and {count - 1} more)" if count > 1 else ""
        raise WetwellError(f"{failures[0].error}{more}")


def _attempt(work: Callable[[Task], Result], task: Task) -> Result | Failure:
    try:
        return work(task)
    except WetwellError as error:
        return Failure(str(error))
    except Exception as error:  # a fault in one task is not the others'
        log.exception("a task failed")
        return Failure(_one_line(error))


def _one_line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _in_parallel(
    work: Callable[[Task], Result | Failure], tasks: Iterable[Task], workers: int, scheduler: str | None
) -> Iterator[tuple[int, Result | Failure]]:
    left = enumerate(tasks)
    while suspects := (yield from _until_killed(work, left, workers, scheduler)):
        for number, task in suspects:  # one of them may have killed the process that they shared
            yield number, _alone(work, task)


def _until_killed(
    work: Callable[[Task], Result | Failure],
    left: Iterator[tuple[int, Task]],
    workers: int,
    scheduler: str | None,
) -> Generator[tuple[int, Result | Failure], None, list[tuple[int, Task]]]:
    """Work until all is done; or until a process of this machine was killed, and say what was not done then."""
    waiting: dict[Future[Result | Failure], tuple[int, Task]] = {}
    with noted_interrupts() as is_interrupted, pool_of(workers, scheduler) as (pool, size):
        while True:
            if is_interrupted():
                raise KeyboardInterrupt
            with held_interrupts():  # processes that are started here inherit it
                for number, task in islice(left, max(_AHEAD * size() - len(waiting), 0)):
                    try:
                        waiting[pool.submit(work, task)] = number, task
                    except BrokenProcessPool:
                        return [*waiting.values(), (number, task)]
            if not waiting:
                return []
            for future in wait(waiting, WATCH_S, return_when=FIRST_COMPLETED).done:
                try:
                    result = future.result()
                except BrokenProcessPool:
                    return list(waiting.values())
                except CancelledError as error:
                    raise LinkError(f"--scheduler: {scheduler} is gone; run again, what is done is kept") from error
                except Exception as error:  # noqa: BLE001 - workers that died of a task, or do not know the work
                    result = Failure(_one_line(error))
                yield waiting.pop(future)[0], result


def _alone(work: Callable[[Task], Result | Failure], task: Task) -> Result | Failure:
    with pool_of(1, None) as (pool, _):
        try:
            with held_interrupts():
                future = pool.submit(work, task)
            return future.result()
        except BrokenProcessPool:
            return Failure("its process was killed (out of memory?)")
