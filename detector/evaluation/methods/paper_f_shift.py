"""The best plain reading of the paper's first method: an F-test of each run against the learnt curve."""

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.evaluation.methods.run_detector import ALPHA, RunDetector, state_of
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.f_distribution import log_f_survival
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import State


class PaperFShift(RunDetector):
    r"""F-test whether the mean of a level residual has moved from where the n runs of learning had it.

    $$F = \frac{(\bar{r} - \bar{r}_0)^2}{s_0^2 (1 + 1/n)} \sim F_{1,\, n - 1}, \qquad
    s_0^2 \text{ the variance of the } n \text{ run means}$$

    r_p and r_s are tested each for itself, at `ALPHA`. Slopes are the datasheet's: with noise in Q, slopes fitted to
    one operating point shrink to nothing. What noise in Q adds to the mean of Q² is the same before and after and
    cancels. With run means, not samples, in the denominator, slow noise counts as what it is.

    References
    ----------
    .. [1] N. R. Draper, H. Smith, Applied Regression Analysis, 3rd edition, Wiley 1998 (extra sum of squares).
    """

    def __init__(self, station: str, datasheet: Datasheet) -> None:
        super().__init__(station, datasheet)
        self._means_m: list[Floats] = [np.empty((0, 2)) for _ in range(datasheet.pumps)]

    def learn(self, pump: int, runs: list[Run]) -> None:
        self._means_m[pump] = np.array([run.segments.residual_m.mean(axis=0) for run in runs])

    def told(self, run: Run) -> State:
        learnt_m = self._means_m[run.pump]
        count = len(learnt_m)
        variance = learnt_m.var(axis=0, ddof=1) * (1.0 + 1.0 / count)
        ratios = (run.segments.residual_m.mean(axis=0) - learnt_m.mean(axis=0)) ** 2 / variance
        pump, system = (log_f_survival(float(ratio), 1, count - 1) < np.log(ALPHA) for ratio in ratios)
        return state_of(pump=bool(pump), system=bool(system))
