"""The figures in a verdict: both methods of the paper, on one run."""

from typing import Any

import numpy as np

from wetwell.detector.baseline import Baseline
from wetwell.detector.bootstrap import block_bootstrap_interval
from wetwell.detector.curve_drift import pump_curve_f_test, system_curve_f_test
from wetwell.detector.f_test import FTest
from wetwell.detector.runs import Run
from wetwell.detector.tangent import attribution_index

MIN_SAMPLES = 10
RESAMPLES = 500
CONFIDENCE = 0.95
BLOCK_SEGMENTS = 2


def run_evidence(run: Run, baseline: Baseline | None, rng: np.random.Generator) -> dict[str, Any]:
    """Figures of both methods on a run.

    `f_test`: drift of either curve within the run. `index`: share of the pump in the way from the learnt operating
    point to the segments of the run, with its block-bootstrap interval; only once a baseline is learnt.
    """
    evidence: dict[str, Any] = {}
    if len(run.time_s) >= MIN_SAMPLES:
        evidence["f_test"] = {
            "pump": f_test_figures(pump_curve_f_test(run.time_s, run.flow_m3h, run.head_m, run.speed_ratio)),
            "system": f_test_figures(system_curve_f_test(run.time_s, run.total_flow_m3h, run.head_m)),
        }
    if baseline is not None:
        pump_m, system_m = (run.segments - baseline.offset_m).T
        low, high = block_bootstrap_interval(
            pump_m,
            system_m,
            block=min(BLOCK_SEGMENTS, len(pump_m)),
            resamples=RESAMPLES,
            confidence=CONFIDENCE,
            rng=rng,
        )
        evidence["index"] = {"value": round(attribution_index(pump_m, system_m), 4), "interval": [low, high]}
    return evidence


def f_test_figures(test: FTest) -> dict[str, float]:
    """An F-test as a message carries it."""
    return {
        "f": test.f,
        "log_p": test.log_p,
        "aic_null": test.aic_null,
        "aic_alternative": test.aic_alternative,
        "samples": test.samples,
    }
