"""The learning phase of one pump: at least six hours of station time, and runs that agree with one another."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from wetwell.detector.baseline.model import FLOOR_SHARE, MIN_RUNS, MIN_SEGMENTS, Baseline, learn
from wetwell.detector.curves.datasheet import Curve
from wetwell.detector.curves.sensor_signatures import flow_meter_direction
from wetwell.detector.runs.run import Segments
from wetwell.detector.statistics.robust import step_variance
from wetwell.detector.stream.steady_samples import SEGMENT_SAMPLES
from wetwell.protocols.arrays import Floats
from wetwell.protocols.timestamps import LEARNING_S

DAY_S = 24.0 * 3600.0
LEAST_SEGMENTS = 24
"""Segments of a slow feed to learn from: they tell a standard deviation within 15 %."""
DRIFT_SIGMAS = 5.0
WANDERING_SHARE = 0.02
"""A flow meter may wander by this standard deviation over a day and still be a healthy one."""
SIBLING_SHARE = 0.1
"""Pumps with the same curve may differ by this share of their shut-off head."""


class Learning:
    """Collects the runs of one pump until they can serve as a baseline.

    Only the last `LEARNING_S` in which the station was seen count, whatever its clock was set to (but always
    `MIN_RUNS`, and of a slow feed `LEAST_SEGMENTS`), so that a disturbance passes out of sight when it is over. While
    the runs disagree, learning goes on and `reason` says why. A flow meter that wanders a little over the day moves
    both residuals in a direction of its own: then learning takes a whole day, and the wandering becomes part of the
    scatter.

    Memory: the segments of a day.
    """

    def __init__(self) -> None:
        self._runs: deque[tuple[float, Segments]] = deque()
        self._is_wandering = False
        self.reason = "no pump run yet"

    @property
    def offset_m(self) -> float | None:
        """Mean of r_p over the runs so far. [m]."""
        if not self._runs:
            return None
        return float(sum(run.residual_m[:, 0].mean() for _, run in self._runs) / len(self._runs))

    def add(self, segments: Segments, seen_s: float) -> None:
        """Take a run into account that ended when the station had been seen for so long.

        Runs with too few segments are passed over.
        """
        if len(segments) < MIN_SEGMENTS:
            return
        self._runs.append((seen_s, segments))
        while seen_s - self._runs[0][0] > DAY_S and _are_enough([run for _, run in self._runs][1:]):
            self._runs.popleft()

    def runs(self, seen_s: float, window_s: float) -> list[Segments]:
        """The runs of the last so many seconds, or of more where those are too few."""
        runs = [run for _, run in self._runs]
        first = sum(seen_s - at_s > window_s for at_s, _ in self._runs)
        while first and not _are_enough(runs[first:]):
            first -= 1
        return runs[first:]

    def is_empty(self, seen_s: float) -> bool:
        """Whether a day of station time has brought no run that can be used."""
        return seen_s > DAY_S and not self._runs

    def baseline(self, seen_s: float, curve: Curve, friction_h2_m5: float) -> tuple[Baseline, list[Segments]] | None:
        """The baseline and the runs that it comes from, or None while learning has to go on."""
        if seen_s < LEARNING_S:
            self.reason = f"{seen_s / 3600.0:.1f} of {LEARNING_S / 3600.0:.0f} h"
            return None
        if len(self._runs) < MIN_RUNS:
            self.reason = f"{len(self._runs)} of {MIN_RUNS} usable runs"
            return None
        if not _are_enough([run for _, run in self._runs]):
            self.reason = f"{sum(len(run) for _, run in self._runs)} of {LEAST_SEGMENTS} usable segments"
            return None
        if self._is_wandering:
            return self._over_a_day(seen_s, curve, friction_h2_m5)
        runs = self.runs(seen_s, LEARNING_S)
        baseline = learn(runs, curve, friction_h2_m5)
        deviations_m = baseline.deviations(runs)
        doubt = stationarity_rejection(deviations_m, baseline, runs, curve[0])
        if doubt is None:
            self.reason = ""
            return baseline, runs
        self.reason = doubt
        across_m, gains = _meter_apart(deviations_m, baseline, curve, friction_h2_m5)
        is_like_meter = stationarity_rejection(across_m, baseline, runs, curve[0]) is None
        self._is_wandering = is_like_meter and float(np.std(gains)) <= WANDERING_SHARE
        return None

    def _over_a_day(
        self, seen_s: float, curve: Curve, friction_h2_m5: float
    ) -> tuple[Baseline, list[Segments]] | None:
        if seen_s < DAY_S:
            self.reason = f"the flow meter seems to wander: {seen_s / 3600.0:.1f} of {DAY_S / 3600.0:.0f} h"
            return None
        runs = self.runs(seen_s, DAY_S)
        baseline = learn(runs, curve, friction_h2_m5)
        across_m, gains = _meter_apart(baseline.deviations(runs), baseline, curve, friction_h2_m5)
        doubt = stationarity_rejection(across_m, baseline, runs, curve[0])
        if doubt is None and float(np.std(gains)) <= WANDERING_SHARE:
            self.reason = ""
            return baseline, runs
        self.reason = doubt or f"the flow meter wanders by {np.std(gains):.1%}"
        self._is_wandering = doubt is None
        return None


def _are_enough(runs: Sequence[Segments]) -> bool:
    """Whether runs can serve as a baseline by their number, and of a slow feed by that of their segments."""
    is_slow = bool(runs) and runs[-1].samples < SEGMENT_SAMPLES
    return len(runs) >= MIN_RUNS and (not is_slow or sum(map(len, runs)) >= LEAST_SEGMENTS)


def stationarity_rejection(
    deviations_m: Floats, baseline: Baseline, runs: Sequence[Segments], shutoff_head_m: float
) -> str | None:
    """Why runs cannot serve as a baseline, or None: what they deviate by must not have moved while it was learnt.

    The runs are split in two at every place; the means of the two parts must agree within `DRIFT_SIGMAS`. What one
    run scatters by is told by its noise, or by the differences of neighbouring runs where that is more.

    Parameters
    ----------
    deviations_m : (runs, 2) array
        Of the means of (r_p, r_s) from the baseline. [m]
    baseline : Baseline
        Learnt from these runs.
    runs : sequence of Segments
    shutoff_head_m : float
        Of the pump; its share `FLOOR_SHARE` is the least scatter between runs. [m]
    """
    floor = (FLOOR_SHARE * shutoff_head_m) ** 2
    segments = np.mean([len(run) for run in runs])
    neighbours = step_variance(deviations_m)
    variance = np.maximum(np.diag(baseline.segment_covariance) / segments + floor, neighbours)
    for split in range(1, len(runs)):
        shift_m = deviations_m[split:].mean(axis=0) - deviations_m[:split].mean(axis=0)
        deviation_m = np.sqrt(variance * (1.0 / split + 1.0 / (len(runs) - split)))
        worst = int(np.argmax(np.abs(shift_m) / deviation_m))
        if abs(shift_m[worst]) > DRIFT_SIGMAS * deviation_m[worst]:
            curve = ("pump", "system")[worst]
            return f"the {curve} curve moved by {shift_m[worst]:+.2f} m while it was learnt"
    return None


def _meter_apart(
    deviations_m: Floats, baseline: Baseline, curve: Curve, friction_h2_m5: float
) -> tuple[Floats, Floats]:
    """Deviations without what errors of the flow meter explain, (runs, 2), and those relative errors, (runs,)."""
    flow_m3h, total_m3h = baseline.flow_m3h, baseline.total_m3h
    direction = flow_meter_direction(flow_m3h, flow_m3h, total_m3h, curve, friction_h2_m5)
    gains = deviations_m @ direction / (direction @ direction)
    return deviations_m - np.outer(gains, direction), gains


def sibling_rejection(pump: int, offsets_m: Sequence[float | None], curves: Sequence[Curve]) -> str | None:
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
