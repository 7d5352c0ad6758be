"""The paper's second method as it is written: the tangent index of one-second differences."""

from wetwell.detector.evaluation.methods.index_method import IndexMethod
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.tangent import tangent_residuals
from wetwell.protocols.arrays import Floats


class PaperTangent(IndexMethod):
    """Index of the steps between neighbouring samples of a run, with slopes from the datasheet.

    References
    ----------
    .. [1] M. Eshkofti et al., Modeling and Physics-Enhanced Fault Detection in Wastewater Pump Stations: tangent
       residuals.
    """

    block = 5

    def _residuals(self, run: Run) -> tuple[Floats, Floats]:
        return tangent_residuals(
            run.flow_m3h,
            run.head_m,
            run.speed_ratio,
            curve=self._datasheet.curves[run.pump],
            friction_h2_m5=self._datasheet.main_of(run.pump).friction_h2_m5,
            total_flow_m3h=run.total_flow_m3h,
        )
