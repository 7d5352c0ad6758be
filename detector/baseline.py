"""The baseline: where the residuals of a healthy pump lie, and how they scatter. Learnt, checked, then fixed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wetwell.detector.runs import Run

Floats = npt.NDArray[np.float64]

MIN_RUNS = 4
MIN_SEGMENTS = 2
FLOOR_SHARE = 0.002
"""Smallest standard deviation of a run's mean, as a share of the shut-off head: slow sensor bias."""
DRIFT_SIGMAS = 5.0
SIBLING_SHARE = 0.1
"""Pumps with the same curve may differ by this share of their shut-off head."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """A healthy pump, seen from its datasheet.

    Attributes
    ----------
    offset_m : (2,) array
        Median of the level residuals (r_p, r_s). [m]
    segment_covariance : (2, 2) array
        Covariance of segment means within a run, times `correlation_factor`. [m²]
    correlation_factor : float
        Growth of the variance of a run's mean by correlation between its segments.
    run_variance : (2,) array
        Variance of run means that the scatter within runs does not explain, floor included. [m²]
    flow_m3h, total_m3h : float
        Median of Q/N and of the total flow: where the offset was learnt. [m³/h]
    """

    offset_m: Floats
    segment_covariance: Floats
    correlation_factor: float
    run_variance: Floats
    flow_m3h: float
    total_m3h: float

    def with_noise_of(self, run: Run, weight: float) -> "Baseline":
        """The baseline with its scatter moved towards that of a normal run; the offset never moves."""
        if len(run.segments) < 3:
            return self
        recent = np.cov(run.segments, rowvar=False) * self.correlation_factor
        limit = 4.0 * np.trace(self.segment_covariance)
        recent *= min(1.0, limit / max(float(np.trace(recent)), 1e-300))
        return replace(self, segment_covariance=(1.0 - weight) * self.segment_covariance + weight * recent)


def learn(runs: Sequence[Run], shutoff_head_m: float) -> Baseline:
    """Baseline from the fault-free runs of one pump, at least `MIN_RUNS` with `MIN_SEGMENTS` segments each."""
    means = np.array([run.segments.mean(axis=0) for run in runs])
    counts = np.array([len(run.segments) for run in runs])
    centred = np.concatenate([run.segments - mean for run, mean in zip(runs, means, strict=True)])
    freedom = max(len(centred) - len(runs), 1)
    factor = _correlation_factor(runs)
    within = centred.T @ centred / freedom * factor
    unexplained = means.var(axis=0, ddof=1) - np.diag(within) * np.mean(1.0 / counts)
    floor = (FLOOR_SHARE * shutoff_head_m) ** 2
    flow = np.concatenate([run.flow_m3h / run.speed_ratio for run in runs])
    total = np.concatenate([run.total_flow_m3h for run in runs])
    return Baseline(
        offset_m=np.median(np.concatenate([run.segments for run in runs]), axis=0),
        segment_covariance=within,
        correlation_factor=factor,
        run_variance=np.maximum(unexplained, 0.0) + floor,
        flow_m3h=float(np.median(flow)),
        total_m3h=float(np.median(total)),
    )


def _correlation_factor(runs: Sequence[Run]) -> float:
    """Growth of the variance of a run's mean by correlation between its segments: (1 + ρ)/(1 − ρ), ρ in 0..0.9."""
    products = squares = 0.0
    for run in runs:
        centred = run.segments - run.segments.mean(axis=0)
        products += float(np.sum(centred[1:] * centred[:-1]))
        squares += float(np.sum(centred**2))
    correlation = min(max(products / squares, 0.0), 0.9) if squares > 0.0 else 0.0
    return (1.0 + correlation) / (1.0 - correlation)


def objection(runs: Sequence[Run], shutoff_head_m: float) -> str | None:
    """Why these runs cannot serve as a baseline, or None: the residuals must not have moved while it was learnt.

    The runs are split in two at every place; the means of the two parts must agree within `DRIFT_SIGMAS`.
    """
    means = np.array([run.segments.mean(axis=0) for run in runs])
    baseline = learn(runs, shutoff_head_m)
    floor = (FLOOR_SHARE * shutoff_head_m) ** 2
    segments = np.mean([len(run.segments) for run in runs])
    variance = np.diag(baseline.segment_covariance) / segments + floor
    for split in range(1, len(runs)):
        shift_m = means[split:].mean(axis=0) - means[:split].mean(axis=0)
        deviation_m = np.sqrt(variance * (1.0 / split + 1.0 / (len(runs) - split)))
        worst = int(np.argmax(np.abs(shift_m) / deviation_m))
        if abs(shift_m[worst]) > DRIFT_SIGMAS * deviation_m[worst]:
            curve = ("pump", "system")[worst]
            return f"the {curve} curve moved by {shift_m[worst]:+.2f} m while it was learnt"
    return None


def sibling_objection(
    pump: int, offsets_m: Sequence[float | None], curves: Sequence[tuple[float, float, float]]
) -> str | None:
    """Why a pump cannot be healthy if its siblings are, or None.

    Parameters
    ----------
    pump : int
        From 0.
    offsets_m : sequence
        Mean of r_p of each pump in learning, None where it is not known. [m]
    curves : sequence
        Curves of the pumps; only pumps with the same curve are compared.
    """
    own_m = offsets_m[pump]
    siblings_m = [
        offset_m
        for other, offset_m in enumerate(offsets_m)
        if other != pump and offset_m is not None and curves[other] == curves[pump]
    ]
    if own_m is None or not siblings_m:
        return None
    gap_m = own_m - float(np.median(siblings_m))
    if abs(gap_m) <= SIBLING_SHARE * curves[pump][0]:
        return None
    return f"its curve lies {gap_m:+.1f} m from that of its siblings, so that one of them is not healthy"
