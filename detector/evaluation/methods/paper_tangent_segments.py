"""The best plain reading of the paper's second method: the tangent index across runs."""

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.evaluation.methods.index_method import IndexMethod
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.tangent import normalise, pump_slope, segment_means, system_slope
from wetwell.detector.stream.steady_samples import SEGMENT_SAMPLES
from wetwell.protocols.arrays import Floats


class PaperTangentSegments(IndexMethod):
    r"""Index of the steps from the learnt operating point to the 25-sample segments of a run.

    $$\psi_p = H^\star - H^\star_0 - m_p(\tfrac{Q^\star + Q^\star_0}{2}) (Q^\star - Q^\star_0), \qquad
    \psi_s = H - H_0 - m_s(\tfrac{Q + Q_0}{2}) (Q - Q_0)$$

    A step within a run sees only how far a fault has grown in minutes; this one sees all that it has grown since
    learning.

    References
    ----------
    .. [1] M. Eshkofti et al., Modeling and Physics-Enhanced Fault Detection in Wastewater Pump Stations: tangent
       residuals, analysis segments of 25 samples.
    """

    block = 2

    def __init__(self, station: str, datasheet: Datasheet) -> None:
        super().__init__(station, datasheet)
        self._learnt = np.full((datasheet.pumps, 4), np.nan)

    def learn(self, pump: int, runs: list[Run]) -> None:
        self._learnt[pump] = np.mean(np.concatenate([_segments(run) for run in runs], axis=1), axis=1)
        super().learn(pump, runs)

    def _residuals(self, run: Run) -> tuple[Floats, Floats]:
        now, learnt = _segments(run), self._learnt[run.pump][:, np.newaxis]
        step, (middle, _, total, _) = now - learnt, (now + learnt) / 2.0
        psi_p = step[1] - pump_slope(middle, self._datasheet.curves[run.pump]) * step[0]
        psi_s = step[3] - system_slope(total, self._datasheet.main_of(run.pump).friction_h2_m5) * step[2]
        return psi_p, psi_s


def _segments(run: Run) -> Floats:
    """(4, m) segment means of flow and head at nominal speed, and of total flow and head as measured."""
    flow, head = normalise(run.flow_m3h, run.head_m, run.speed_ratio)
    return np.array(
        [segment_means(values, SEGMENT_SAMPLES) for values in (flow, head, run.total_flow_m3h, run.head_m)]
    )
