"""An outside baseline: the CUSUM test of statsmodels on the level residuals."""

import numpy as np
from statsmodels.stats.diagnostic import breaks_cusumolsresid

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.evaluation.methods.run_detector import ALPHA, RunDetector, state_of
from wetwell.detector.runs.run import Run
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import State


class CusumStatsmodels(RunDetector):
    """OLS-CUSUM test for a break between the segments of the learning phase and those of a run, at `ALPHA`.

    r_p and r_s are tested each for itself; the regression behind the residuals is a constant.

    References
    ----------
    .. [1] W. Ploberger, W. Krämer, The CUSUM test with OLS residuals, Econometrica 60, 1992.
    """

    def __init__(self, station: str, datasheet: Datasheet) -> None:
        super().__init__(station, datasheet)
        self._learnt_m: list[Floats] = [np.empty((0, 2)) for _ in range(datasheet.pumps)]

    def learn(self, pump: int, runs: list[Run]) -> None:
        self._learnt_m[pump] = np.concatenate([run.segments.residual_m for run in runs])

    def told(self, run: Run) -> State:
        series_m = np.concatenate([self._learnt_m[run.pump], run.segments.residual_m])
        pump, system = (
            breaks_cusumolsresid(residual_m, ddof=1)[1] < ALPHA for residual_m in (series_m - series_m.mean(axis=0)).T
        )
        return state_of(pump=bool(pump), system=bool(system))
