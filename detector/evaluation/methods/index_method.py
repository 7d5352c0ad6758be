"""What both readings of the paper's second method share: an index a run, and limits that follow its normal runs."""

from abc import abstractmethod
from collections import deque

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.evaluation.methods.run_detector import RunDetector
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.bootstrap import block_bootstrap_interval
from wetwell.detector.statistics.tangent import attribution_index
from wetwell.detector.verdict.control_limits import OUTER_SHARE, PUMP_ABOVE, RUNS, SYSTEM_BELOW
from wetwell.detector.verdict.evidence import CONFIDENCE, RESAMPLES
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import State


class IndexMethod(RunDetector):
    """Attribution index of a run with its block-bootstrap interval, held against adaptive limits.

    The limits are the outer 5 % of the index of the learning phase, and never inside the paper's 0.4 and 0.6; then
    they follow the last `RUNS` runs that were told normal. The whole interval must lie outside. The paper says that
    the limits follow recent normal data from time to time, not how.
    """

    block: int
    """Neighbouring residuals that are drawn together."""

    def __init__(self, station: str, datasheet: Datasheet) -> None:
        super().__init__(station, datasheet)
        self._healthy: list[deque[float]] = [deque(maxlen=RUNS) for _ in range(datasheet.pumps)]
        self._rng = np.random.default_rng(0)

    @abstractmethod
    def _residuals(self, run: Run) -> tuple[Floats, Floats]:
        """ψ_p and ψ_s of a run."""

    def learn(self, pump: int, runs: list[Run]) -> None:
        self._healthy[pump].extend(attribution_index(*self._residuals(run)) for run in runs)

    def told(self, run: Run) -> State:
        psi_p, psi_s = self._residuals(run)
        if not len(psi_p):
            return "unknown"
        low, high = block_bootstrap_interval(
            psi_p,
            psi_s,
            block=min(self.block, len(psi_p)),
            resamples=RESAMPLES,
            confidence=CONFIDENCE,
            rng=self._rng,
        )
        healthy = self._healthy[run.pump]
        below, above = np.quantile(np.array(healthy), [OUTER_SHARE, 1.0 - OUTER_SHARE])
        if high < min(below, SYSTEM_BELOW):
            return "system_fault"
        if low > max(above, PUMP_ABOVE):
            return "pump_fault"
        healthy.append(attribution_index(psi_p, psi_s))
        return "normal"
