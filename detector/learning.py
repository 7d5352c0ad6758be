"""The learning phase of one pump: at least six hours of station time, and runs that agree with one another."""

from collections import deque

from wetwell.detector.baseline import MIN_RUNS, MIN_SEGMENTS, Baseline, learn, objection
from wetwell.detector.runs import Run

LEARNING_S = 6.0 * 3600.0


class Learning:
    """Collects the runs of one pump until they can serve as a baseline.

    Only the last `LEARNING_S` in which the station was seen count, whatever its clock was set to (but always
    `MIN_RUNS`), so that a disturbance passes out of sight when it is over. While the runs disagree, learning goes on
    and `reason` says why.

    Memory: the steady samples of `LEARNING_S`.
    """

    def __init__(self) -> None:
        self._runs: deque[tuple[float, Run]] = deque()
        self.reason = "no pump run yet"

    @property
    def offset_m(self) -> float | None:
        """Mean of r_p over the runs so far. [m]."""
        if not self._runs:
            return None
        return float(sum(run.segments[:, 0].mean() for _, run in self._runs) / len(self._runs))

    @property
    def runs(self) -> list[Run]:
        """The runs so far."""
        return [run for _, run in self._runs]

    def add(self, run: Run, seen_s: float) -> None:
        """Take a run into account that ended when the station had been seen for so long.

        Runs with too few segments are passed over.
        """
        if len(run.segments) < MIN_SEGMENTS:
            return
        self._runs.append((seen_s, run))
        while len(self._runs) > MIN_RUNS and seen_s - self._runs[0][0] > LEARNING_S:
            self._runs.popleft()

    def baseline(self, seen_s: float, shutoff_head_m: float) -> Baseline | None:
        """The baseline, or None while learning has to go on."""
        if seen_s < LEARNING_S:
            self.reason = f"{seen_s / 3600.0:.1f} of {LEARNING_S / 3600.0:.0f} h"
            return None
        if len(self._runs) < MIN_RUNS:
            self.reason = f"{len(self._runs)} of {MIN_RUNS} usable runs"
            return None
        doubt = objection(self.runs, shutoff_head_m)
        if doubt is not None:
            self.reason = doubt
            return None
        self.reason = ""
        return learn(self.runs, shutoff_head_m)
