"""The learning phase of one pump: at least six hours of station time, and runs that agree with one another."""

from collections import deque

from wetwell.detector.baseline import MIN_RUNS, MIN_SEGMENTS, Baseline, learn, objection
from wetwell.detector.runs import Run
from wetwell.protocols.stamps import NS_PER_S

LEARNING_S = 6.0 * 3600.0


class Learning:
    """Collects the runs of one pump until they can serve as a baseline.

    Only the last `LEARNING_S` count (but always `MIN_RUNS`), so that a disturbance passes out of sight when it is
    over. While the runs disagree, learning goes on and `reason` says why.

    Memory: the steady samples of `LEARNING_S`.
    """

    def __init__(self) -> None:
        self._runs: deque[Run] = deque()
        self._first_ns: int | None = None
        self.reason = "no pump run yet"

    @property
    def offset_m(self) -> float | None:
        """Mean of r_p over the runs so far. [m]."""
        if not self._runs:
            return None
        return float(sum(run.segments[:, 0].mean() for run in self._runs) / len(self._runs))

    def start(self, time_ns: int) -> None:
        """Count the learning time from here on, if it does not count yet."""
        if self._first_ns is None:
            self._first_ns = time_ns

    def add(self, run: Run) -> None:
        """Take a run into account; runs with too few segments are passed over."""
        if len(run.segments) < MIN_SEGMENTS:
            return
        self._runs.append(run)
        while len(self._runs) > MIN_RUNS and (run.window_ns[1] - self._runs[0].window_ns[0] > LEARNING_S * NS_PER_S):
            self._runs.popleft()

    def baseline(self, time_ns: int, shutoff_head_m: float) -> Baseline | None:
        """The baseline, or None while learning has to go on."""
        learnt_s = (time_ns - (self._first_ns if self._first_ns is not None else time_ns)) / NS_PER_S
        if learnt_s < LEARNING_S:
            self.reason = f"{learnt_s / 3600.0:.1f} of {LEARNING_S / 3600.0:.0f} h"
            return None
        if len(self._runs) < MIN_RUNS:
            self.reason = f"{len(self._runs)} of {MIN_RUNS} usable runs"
            return None
        doubt = objection(self._runs, shutoff_head_m)
        if doubt is not None:
            self.reason = doubt
            return None
        self.reason = ""
        return learn(self._runs, shutoff_head_m)
