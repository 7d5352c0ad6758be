"""The baseline: what a healthy pump shows at any operating point, and how it scatters. Learnt, then fixed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wetwell.detector.curves.datasheet import Curve
from wetwell.detector.runs.run import Segments
from wetwell.detector.statistics.robust import NORMAL_MEDIAN, median
from wetwell.detector.stream.steady_samples import SEGMENT_SAMPLES
from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled

MIN_RUNS = 4
MIN_SEGMENTS = 2
FLOOR_SHARE = 0.001
"""Smallest standard deviation of a run's mean, as a share of the shut-off head: slow sensor bias."""
SLOPE_SHARE = 0.1
"""Standard deviation of the datasheet's slopes, as a share of each."""
LEVEL_SLOPE = 0.6
"""Standard deviation of what a metre of level does to a residual, before anything is seen. [m/m]"""
SPREAD_SHARE = 0.01
"""Operating points that lie closer together than this share of the flow say nothing of slopes."""
MAX_CORRELATION = 0.95
OUTLIER_SIGMAS = 3.0
ROUNDING_M = 1e-9
"""Residual of a head that was worked out from the curve itself, at the most."""
LEAST_NOISE_SHARE = 1e-4
"""Least noise of a segment, as a share of the shut-off head: readings without any are rounded, not perfect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    r"""A residual as a function of the operating point, with what is not known of it.

    $$r = \beta_0 + \sum_j \beta_j (x_j - x_{j0}), \qquad \beta \sim N(\hat\beta, V)$$

    Attributes
    ----------
    origin : (p,) array
        x0: where it was learnt.
    mean, covariance : (p + 1,), (p + 1, p + 1) arrays
        Of the offset and the slopes.
    """

    origin: Floats
    mean: Floats
    covariance: Floats

    def variance_at(self, *point: float) -> float:
        """Variance of the residual at an operating point of p numbers. [m²]."""
        basis = np.array([1.0, *(at - origin for at, origin in zip(point, self.origin.tolist(), strict=True))])
        return float(basis @ self.covariance @ basis)

    def along(self, points: Floats) -> tuple[Floats, Floats]:
        """(m,) residuals at operating points (m, p), and the variances of them. [m, m²]."""
        basis = np.column_stack((np.ones(len(points)), points - self.origin))
        return basis @ self.mean, ((basis @ self.covariance) * basis).sum(axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """A healthy pump, seen from its datasheet.

    Attributes
    ----------
    pump, system : Model
        r_p over (Q/N, (Q/N)², level) and r_s over (Q_tot², level). [m]
    duty_fit, duty_total_fit : (2,) arrays
        Intercept and slope that turn flows by the datasheet into those that were measured: Q/N, Q_tot. [m³/h, 1]
    flow_scatter : float
        Twice the standard deviation of the measured flow from that line between runs, as a share of it.
    level_m : float
        Mean level while the pump ran steadily; NaN where no level was measured. [m]
    segment_covariance : (2, 2) array
        Covariance of segment means within a run, times `correlation_factor`. [m²]
    correlation_factor : float
        Growth of the variance of a run's mean by correlation between its segments.
    segment_samples : int
        In each of the learnt segments.
    run_covariance : (2, 2) array
        Covariance of run means that the scatter within runs does not explain, floor included. [m²]
    """

    pump: Model
    system: Model
    duty_fit: Floats
    duty_total_fit: Floats
    flow_scatter: float
    level_m: float
    segment_covariance: Floats
    correlation_factor: float
    run_covariance: Floats
    segment_samples: int = SEGMENT_SAMPLES

    @property
    def offset_m(self) -> Floats:
        """(2,) residuals where they were learnt."""
        return np.array([self.pump.mean[0], self.system.mean[0]])

    @property
    def flow_m3h(self) -> float:
        """Q/N where it was learnt."""
        return float(self.pump.origin[0])

    @property
    def total_m3h(self) -> float:
        """Flow of the main where it was learnt."""
        return float(np.sqrt(self.system.origin[0]))

    @property
    def lacks_head(self) -> bool:
        """Whether it was learnt without a head sensor: then the main takes what its datasheet says, to the digit."""
        return abs(float(self.system.mean[0])) < ROUNDING_M

    def shifts(self, segments: Segments) -> Floats:
        """(m, 2) distance of segments from what the baseline expects at their operating points. [m]."""
        shifts_m = np.empty((len(segments), 2))
        _subtract_expected(
            *(segments.residual_m, segments.flow_m3h, segments.total_m3h, segments.level_m, self._usual_level_m),
            *(self.pump.origin, self.pump.mean, self.system.origin, self.system.mean, shifts_m),
        )
        return shifts_m

    def deviations(self, runs: Sequence[Segments]) -> Floats:
        """(runs, 2) distance of the means of healthy runs from what is expected at the datasheet's flows. [m]."""
        slopes = np.array([self.pump.mean[-1], self.system.mean[-1]])
        at_level = np.full(len(runs), self._usual_level_m)
        flow_m3h = self.duty_fit[0] + self.duty_fit[1] * _means(runs, "duty_m3h")
        total_m3h = self.duty_total_fit[0] + self.duty_total_fit[1] * _means(runs, "duty_total_m3h")
        means = np.array([_without_level(run, slopes, self.level_m).mean(axis=0) for run in runs])
        expected = (
            _expected(self.pump, _pump_points(flow_m3h, at_level)),
            _expected(self.system, _system_points(total_m3h, at_level)),
        )
        deviations: Floats = means - np.column_stack(expected)
        return deviations

    def explained_flows(self, segments: Segments) -> tuple[float, float]:
        """Q/N and Q_tot that the running pumps and their speeds explain, without any fault. [m³/h]."""
        return (
            float(self.duty_fit @ (1.0, median(segments.duty_m3h))),
            float(self.duty_total_fit @ (1.0, median(segments.duty_total_m3h))),
        )

    def variances(self, flow_m3h: float, total_m3h: float, level_m: float) -> Floats:
        """(2,) variances of what is expected at an operating point. [m²]."""
        level_m = self._usual_level_m if math.isnan(level_m) else level_m
        return np.array(
            [
                self.pump.variance_at(flow_m3h, flow_m3h * flow_m3h, level_m),
                self.system.variance_at(total_m3h * total_m3h, level_m),
            ]
        )

    def noise(self, segments: Segments) -> Floats:
        """(2, 2) covariance of such segments in health; more where they hold fewer samples than the learnt ones."""
        covariance: Floats = self.segment_covariance * max(1.0, self.segment_samples / segments.samples)
        return covariance

    def with_noise_of(self, segments: Segments, weight: float, shutoff_head_m: float) -> "Baseline":
        """The baseline with its scatter moved towards that of a normal run; what it expects never moves."""
        if len(segments) < 3 or segments.samples != self.segment_samples:
            return self
        deviation_m = segments.residual_m - segments.residual_m.mean(axis=0)
        recent = deviation_m.T @ deviation_m / (len(segments) - 1) * self.correlation_factor
        recent += np.eye(2) * (LEAST_NOISE_SHARE * shutoff_head_m) ** 2
        limit = 4.0 * float(self.segment_covariance.trace())
        recent *= min(1.0, limit / max(float(recent.trace()), 1e-300))
        return replace(self, segment_covariance=(1.0 - weight) * self.segment_covariance + weight * recent)

    @property
    def _usual_level_m(self) -> float:
        """Mean level while the pump ran; 0 where none was measured."""
        return self.level_m if math.isfinite(self.level_m) else 0.0


def learn(runs: Sequence[Segments], curve: Curve, friction_h2_m5: float) -> Baseline:
    """Baseline from the fault-free runs of one pump, at least `MIN_RUNS` with `MIN_SEGMENTS` segments each.

    The slopes start from those of the datasheet and move as far as the data ask for. The flows that stand for the
    operating point are those that the datasheet says for the running pumps and their speeds, fitted to the measured
    ones: the noise of the flow meter would bend the slopes towards zero (errors in variables).
    """
    floor = (FLOOR_SHARE * curve[0]) ** 2
    level_m = float(np.nanmean(levels)) if np.isfinite(levels := _joined(runs, "level_m")).any() else np.nan
    level_weight_m2 = _level_weight(runs)
    level_slopes = _level_slopes(runs, level_weight_m2)
    centred = [_without_level(run, level_slopes, level_m) for run in runs]
    factor = _correlation_factor(centred)
    deviations = np.concatenate([part - part.mean(axis=0) for part in centred])
    within = deviations.T @ deviations / max(len(deviations) - len(runs), 1) * factor
    within += np.eye(2) * (LEAST_NOISE_SHARE * curve[0]) ** 2
    means = np.array([part.mean(axis=0) for part in centred])
    counts = np.array([len(run) for run in runs])
    measured_m3h = _means(runs, "flow_m3h")
    duty_fit, flow_m3h = _fitted(_means(runs, "duty_m3h"), measured_m3h)
    duty_total_fit, total_m3h = _fitted(_means(runs, "duty_total_m3h"), _means(runs, "total_m3h"))
    level_variance = np.diag(within) / max(level_weight_m2, 1e-300)
    at_level = np.full(len(runs), level_m if np.isfinite(level_m) else 0.0)
    pump_points, system_points = _pump_points(flow_m3h, at_level), _system_points(total_m3h, at_level)
    pump_prior = SLOPE_SHARE**2 * np.array([curve[1] ** 2, curve[2] ** 2])
    system_prior = np.array([(SLOPE_SHARE * friction_h2_m5) ** 2])
    run_covariance = np.eye(2) * floor
    weights = np.ones(len(runs))
    for _ in range(3):
        variance = (np.diag(within)[None, :] / counts[:, None] + np.diag(run_covariance)) / weights[:, None]
        pump = _fit(pump_points, means[:, 0], variance[:, 0], pump_prior, level_slopes[0], level_variance[0])
        system = _fit(system_points, means[:, 1], variance[:, 1], system_prior, level_slopes[1], level_variance[1])
        left = means - np.column_stack([_expected(pump, pump_points), _expected(system, system_points)])
        robust_m = NORMAL_MEDIAN * np.median(np.abs(left), axis=0)
        sigmas = np.abs(left) / np.maximum(robust_m, np.sqrt(np.mean(variance * weights[:, None], axis=0)))
        weights = np.minimum(1.0, OUTLIER_SIGMAS / np.maximum(sigmas.max(axis=1), 1e-12))
        weighted = left * weights[:, None]
        scatter = weighted.T @ weighted / max(float(np.sum(weights**2)) - 1.0, 1.0)
        run_covariance = _positive(scatter - within * np.mean(1.0 / counts)) + np.eye(2) * floor
    return Baseline(
        pump=pump,
        system=system,
        duty_fit=duty_fit,
        duty_total_fit=duty_total_fit,
        flow_scatter=2.0 * float(np.std(measured_m3h - flow_m3h)) / max(float(flow_m3h.mean()), 1e-9),
        level_m=level_m,
        segment_covariance=within,
        correlation_factor=factor,
        run_covariance=run_covariance,
        segment_samples=round(float(np.median([run.samples for run in runs]))),
    )


@compiled
def _subtract_expected(
    residual_m: Floats,
    flow_m3h: Floats,
    total_m3h: Floats,
    level_m: Floats,
    usual_level_m: float,
    pump_origin: Floats,
    pump: Floats,
    system_origin: Floats,
    system: Floats,
    shifts_m: Floats,
) -> None:
    """Set the distance of segments from what is expected at their operating points."""
    for at in range(shifts_m.shape[0]):
        level = usual_level_m if math.isnan(level_m[at]) else level_m[at]
        flow, square = flow_m3h[at], total_m3h[at] * total_m3h[at]
        expected_m = pump[0] + pump[1] * (flow - pump_origin[0]) + pump[2] * (flow * flow - pump_origin[1])
        shifts_m[at, 0] = residual_m[at, 0] - (expected_m + pump[3] * (level - pump_origin[2]))
        expected_m = system[0] + system[1] * (square - system_origin[0])
        shifts_m[at, 1] = residual_m[at, 1] - (expected_m + system[2] * (level - system_origin[1]))


def _pump_points(flow_m3h: Floats, level_m: Floats) -> Floats:
    return np.column_stack([flow_m3h, flow_m3h**2, level_m])


def _system_points(total_m3h: Floats, level_m: Floats) -> Floats:
    return np.column_stack([total_m3h**2, level_m])


def _joined(runs: Sequence[Segments], name: str) -> Floats:
    return np.concatenate([getattr(run, name) for run in runs])


def _means(runs: Sequence[Segments], name: str) -> Floats:
    return np.array([getattr(run, name).mean() for run in runs])


def _level_weight(runs: Sequence[Segments]) -> float:
    """Sum of squares of the level about its mean in each run. [m²]."""
    return float(sum(np.nansum((run.level_m - _mean(run.level_m)) ** 2) for run in runs))


def _level_slopes(runs: Sequence[Segments], level_weight_m2: float) -> Floats:
    """(2,) change of the residuals with the level within runs, drawn towards 0 by its prior. [m/m]."""
    products, noise = np.zeros(2), np.zeros(2)
    for run in runs:
        residual_m = run.residual_m - run.residual_m.mean(axis=0)
        level_m = _known_or_0(run.level_m - _mean(run.level_m))
        products += level_m @ residual_m
        noise += np.sum(residual_m**2, axis=0)
    noise /= max(sum(len(run) - 1 for run in runs), 1)
    slopes: Floats = products / np.maximum(level_weight_m2 + noise / LEVEL_SLOPE**2, 1e-300)
    return slopes


def _without_level(run: Segments, slopes: Floats, level_m: float) -> Floats:
    """Residuals of a run as they would be at one level; as they are where the level is not known."""
    return run.residual_m - np.outer(_known_or_0(run.level_m - level_m), slopes)


def _known_or_0(values: Floats) -> Floats:
    return np.where(np.isnan(values), 0.0, values)


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else np.nan


def _fitted(by_datasheet: Floats, by_meter: Floats) -> tuple[Floats, Floats]:
    """Line from the datasheet's flows of runs to the measured ones, and the (runs,) flows on that line."""
    deviation = by_datasheet - by_datasheet.mean()
    if np.sqrt(np.mean(deviation**2)) > SPREAD_SHARE * max(by_datasheet.mean(), 1e-9):
        slope = float(deviation @ by_meter / (deviation @ deviation))
    else:
        slope = 1.0
    fit = np.array([by_meter.mean() - slope * by_datasheet.mean(), slope])
    return fit, fit[0] + fit[1] * by_datasheet


def _fit(
    points: Floats, values: Floats, variance: Floats, slope_prior: Floats, level_slope: float, level_variance: float
) -> Model:
    """Bayesian regression on all but the level, of which the slope is known from within the runs."""
    origin = points.mean(axis=0)
    basis = np.column_stack([np.ones(len(points)), (points - origin)[:, :-1]])
    weighted = basis / variance[:, None]
    precision = basis.T @ weighted
    precision[1:, 1:] += np.diag(1.0 / np.maximum(slope_prior, 1e-300))
    scale = np.sqrt(np.diag(precision))
    covariance = np.linalg.inv(precision / np.outer(scale, scale)) / np.outer(scale, scale)
    mean = covariance @ (weighted.T @ values)
    slopes = len(mean)
    full = np.zeros((slopes + 1, slopes + 1))
    full[:slopes, :slopes] = covariance
    full[-1, -1] = min(level_variance, LEVEL_SLOPE**2)
    return Model(
        origin=origin,
        mean=np.append(mean, level_slope),
        covariance=full,
    )


def _expected(model: Model, points: Floats) -> Floats:
    expected: Floats = model.mean[0] + (points - model.origin) @ model.mean[1:]
    return expected


def _positive(covariance: Floats) -> Floats:
    """The nearest covariance without negative variances."""
    values, vectors = np.linalg.eigh(covariance)
    nearest: Floats = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return nearest


def _correlation_factor(parts: Sequence[Floats]) -> float:
    """Growth of the variance of a run's mean by correlation between its segments: (1 + ρ)/(1 − ρ), ρ >= 0."""
    products = squares = 0.0
    for part in parts:
        centred = part - part.mean(axis=0)
        products += float(np.sum(centred[1:] * centred[:-1]))
        squares += float(np.sum(centred**2))
    correlation = min(max(products / squares, 0.0), MAX_CORRELATION) if squares > 0.0 else 0.0
    return (1.0 + correlation) / (1.0 - correlation)
