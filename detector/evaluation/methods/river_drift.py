"""Outside baselines: drift detectors of river on the level residuals."""

from typing import Any

import numpy as np
from river.drift import ADWIN, PageHinkley

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.evaluation.methods.run_detector import RunDetector, state_of
from wetwell.detector.runs.run import Run
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import State

AWAY_SIGMAS = 3.0


class RiverDrift(RunDetector):
    """A drift detector on each level residual of each pump, in units of its learnt deviation, a segment at a time.

    A drift detector says when a mean has changed, not to what. So a drift raises the alarm of its curve if the run in
    which it is seen lies more than `AWAY_SIGMAS` (of learnt run means) from where learning had it, and ends it if
    not.
    """

    def __init__(self, station: str, datasheet: Datasheet) -> None:
        super().__init__(station, datasheet)
        self._detectors = [[self._new() for _ in range(2)] for _ in range(datasheet.pumps)]
        self._alarms = np.zeros((datasheet.pumps, 2), dtype=np.bool_)
        self._centre_m = np.zeros((datasheet.pumps, 2))
        self._segment_sd_m = np.ones((datasheet.pumps, 2))
        self._run_sd_m = np.ones((datasheet.pumps, 2))

    def _new(self) -> Any:
        raise NotImplementedError

    def learn(self, pump: int, runs: list[Run]) -> None:
        segments_m = np.concatenate([run.segments.residual_m for run in runs])
        self._centre_m[pump] = segments_m.mean(axis=0)
        self._segment_sd_m[pump] = segments_m.std(axis=0, ddof=1)
        self._run_sd_m[pump] = np.array([run.segments.residual_m.mean(axis=0) for run in runs]).std(axis=0, ddof=1)
        self._drifts(pump, segments_m)

    def told(self, run: Run) -> State:
        away = (
            abs(run.segments.residual_m.mean(axis=0) - self._centre_m[run.pump])
            > AWAY_SIGMAS * self._run_sd_m[run.pump]
        )
        drifts = self._drifts(run.pump, run.segments.residual_m)
        alarms = self._alarms[run.pump]
        alarms[drifts] = away[drifts]
        return state_of(pump=bool(alarms[0]), system=bool(alarms[1]))

    def _drifts(self, pump: int, segments_m: Floats) -> Any:
        """(2,) flags of the residuals of which a drift was seen in these segments."""
        drifts = np.zeros(2, dtype=np.bool_)
        for segment in (segments_m - self._centre_m[pump]) / self._segment_sd_m[pump]:
            for curve, detector in enumerate(self._detectors[pump]):
                detector.update(float(segment[curve]))
                drifts[curve] |= detector.drift_detected
        return drifts


class RiverAdwin(RiverDrift):
    """Adaptive windowing with river's own parameters, asked at every segment.

    References
    ----------
    .. [1] A. Bifet, R. Gavaldà, Learning from time-changing data with adaptive windowing, SIAM SDM 2007.
    """

    def _new(self) -> Any:
        return ADWIN(clock=1)


class RiverPageHinkley(RiverDrift):
    """Two-sided Page-Hinkley test with river's own parameters.

    References
    ----------
    .. [1] E. S. Page, Continuous inspection schemes, Biometrika 41, 1954.
    """

    def _new(self) -> Any:
        return PageHinkley()
