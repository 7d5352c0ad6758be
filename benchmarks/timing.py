"""How the benchmarks time a run."""

import time
from collections.abc import Callable


def least_s(run: Callable[[], object], repeats: int) -> float:
    """Shortest of some times of a run, as the processor counts them: waiting for other programs is no part."""
    times_s = []
    for _ in range(repeats):
        started_s = time.process_time()
        run()
        times_s.append(time.process_time() - started_s)
    return min(times_s)
