"""The paper's first method as it is written: drift of the curves within each run."""

import math

from wetwell.detector.evaluation.methods.run_detector import RunDetector
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.curve_drift import pump_curve_f_test, system_curve_f_test
from wetwell.protocols.messages.verdict import State

LOG_ALPHA = math.log(0.05)


class PaperFTest(RunDetector):
    """Nested F-test for drift of each curve in each run; the smaller p is told where it is below 5 %.

    The null models are fitted to the run itself, so that nothing is learnt; the first six hours are passed over, as
    with all methods. The paper gives no level for this test; 5 % is the one of its intervals. It has three states,
    hence no "both".

    References
    ----------
    .. [1] M. Eshkofti et al., Modeling and Physics-Enhanced Fault Detection in Wastewater Pump Stations: nested
       F-test.
    """

    def learn(self, pump: int, runs: list[Run]) -> None:
        pass

    def told(self, run: Run) -> State:
        pump = pump_curve_f_test(run.time_s, run.flow_m3h, run.head_m, run.speed_ratio).log_p
        system = system_curve_f_test(run.time_s, run.total_flow_m3h, run.head_m).log_p
        if min(pump, system) >= LOG_ALPHA:
            return "normal"
        return "pump_fault" if pump < system else "system_fault"
