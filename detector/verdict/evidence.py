"""The figures in a verdict: both methods of the paper, and what the verdict rests on."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.inference.observation import COMPONENTS, Observation
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.bootstrap import block_bootstrap_interval
from wetwell.detector.statistics.curve_drift import CurveFTests, pump_curve_f_test, system_curve_f_test
from wetwell.detector.statistics.f_test import FTest
from wetwell.detector.statistics.tangent import attribution_index, tangent_residuals
from wetwell.protocols.arrays import Floats

MIN_SAMPLES = 10
RESAMPLES = 500
CONFIDENCE = 0.95
BLOCK_SEGMENTS = 2


def run_evidence(run: Run, datasheet: Datasheet, rng: np.random.Generator) -> dict[str, Any]:
    """Figures of both methods of the paper on a run by itself.

    `f_test`: drift of either curve within the run. `tangent`: the attribution index of the steps between its
    segments, with its block-bootstrap interval. Where the main lifts to a delivery level, what the level in the wet
    well does to the lift is no motion of the main.
    """
    evidence: dict[str, Any] = {}
    main = datasheet.main_of(run.pump)
    system_head_m = run.head_m + main.level_slope * run.level_m if main.level_slope else run.head_m
    if len(run.time_s) >= MIN_SAMPLES:
        evidence["f_test"] = {
            "pump": f_test_figures(pump_curve_f_test(run.time_s, run.flow_m3h, run.head_m, run.speed_ratio)),
            "system": f_test_figures(system_curve_f_test(run.time_s, run.total_flow_m3h, system_head_m)),
        }
    if len(run.segments) > 1:
        steps = tangent_residuals(
            run.flow_m3h,
            run.head_m,
            run.speed_ratio,
            curve=datasheet.curves[run.pump],
            friction_h2_m5=main.friction_h2_m5,
            samples_per_segment=run.segments.samples,
            total_flow_m3h=run.total_flow_m3h,
            system_head_m=system_head_m,
        )
        evidence["tangent"] = index_figures(*steps, rng)
    return evidence


def index_figures(pump_m: Floats, system_m: Floats, rng: np.random.Generator) -> dict[str, Any]:
    """Attribution index of residuals and its 95 % interval, as a message carries it."""
    low, high = block_bootstrap_interval(
        pump_m,
        system_m,
        block=min(BLOCK_SEGMENTS, len(pump_m)),
        resamples=RESAMPLES,
        confidence=CONFIDENCE,
        rng=rng,
    )
    return {"value": round(attribution_index(pump_m, system_m), 4), "interval": [round(low, 4), round(high, 4)]}


def shift_evidence(observation: Observation) -> dict[str, Any]:
    """How far each component of an observation lies from the baseline, and which signals that rests on."""
    known = {
        name: (mean, sigmas)
        for name, mean, sigmas in zip(COMPONENTS, observation.mean, observation.sigmas, strict=True)
        if np.isfinite(sigmas)
    }
    signals = ["flow", "head", "frequency", *(name for name in ("drawdown", "power") if name in known)]
    return {
        "shift_m": {name: round(float(known[name][0]), 4) for name in ("pump", "system")},
        "shift_sigmas": {name: round(float(sigmas), 2) for name, (_, sigmas) in known.items()},
        "signals": signals,
    }


def rolling_evidence(tests: CurveFTests, strongest_log_p: Mapping[str, float]) -> dict[str, Any]:
    """Both F-tests over the last steady samples, and the least log p of each since the verdict before."""
    return {
        "pump": f_test_figures(tests.pump),
        "system": f_test_figures(tests.system),
        "strongest_log_p": strongest_log_p,
    }


def f_test_figures(test: FTest) -> dict[str, float]:
    """An F-test as a message carries it."""
    return {
        "f": test.f,
        "log_p": test.log_p,
        "aic_null": test.aic_null,
        "aic_alternative": test.aic_alternative,
        "samples": test.samples,
    }
