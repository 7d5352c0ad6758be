"""What a run shows, as distances from what its pump's baseline expects."""

import math
from dataclasses import dataclass

import numpy as np

from wetwell.detector.baseline.healthy_reference import HealthyReference, log_power
from wetwell.detector.curves.datasheet import Curve
from wetwell.detector.curves.sensor_signatures import flow_meter_direction, head_sensor_direction
from wetwell.detector.runs.run import Run
from wetwell.detector.statistics.robust import median, step_variance
from wetwell.protocols.arrays import Floats

PUMP, SYSTEM, DRAWDOWN, POWER = range(4)
"""Components of an observation."""
COMPONENTS = ("pump", "system", "drawdown", "power")

MIN_STEPS = 4
NOISIER_FACTOR = 3.0
"""A run's own variance counts where it is larger than this times the learnt one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """How far a run lies from the baseline.

    Attributes
    ----------
    mean : (4,) array
        Shift of (r_p, r_s) in m, and of the logarithms of metered flow over drawdown flow and of the power; NaN where
        it is not known, as r_s without a head sensor.
    covariance : (4, 4) array
        Of that mean if nothing has changed: noise, scatter between runs, and what the slopes may be wrong by over the
        way that the flow of a healthy pump goes.
    slope_variance : (2,) array
        More of it where a fault has moved the flow: what the slopes may be wrong by over the rest of the way. [m²]
    flow_meter, head_sensor : (4,) arrays
        Change of the mean with the relative error of the flow meter, and with a metre that the head sensor reads too
        much.
    system_in_pump : float
        What a metre of r_s adds to r_p: nothing where the head is measured. Without a head sensor the head comes from
        the datasheet of the main, and r_p is $r_p - r_s / N^2$ of the pump as it is. [1]
    """

    mean: Floats
    covariance: Floats
    slope_variance: Floats
    flow_meter: Floats
    head_sensor: Floats
    system_in_pump: float = 0.0

    @property
    def sigmas(self) -> Floats:
        """(4,) shift over its standard deviation."""
        sigmas: Floats = self.mean / np.sqrt(self.covariance.diagonal())
        return sigmas


def observe(run: Run, reference: HealthyReference, curve: Curve, friction_h2_m5: float) -> Observation:
    """Observation of a run with at least one segment.

    The median over its segments, whose variance is π/2 times that of the mean: a run in which something comes or goes
    is told by its longer part, and a burst within it does not tell. Where a run scatters more than the learnt ones
    its own scatter counts.

    Parameters
    ----------
    run : Run
    reference : HealthyReference
        Of its pump.
    curve, friction_h2_m5
        By the datasheet.
    """
    segments, baseline = run.segments, reference.baseline
    shifts_m = baseline.shifts(segments)
    flow_m3h, total_m3h = float(median(segments.flow_m3h)), float(median(segments.total_m3h))
    level_m = float(median(segments.level_m))
    healthy_flow_m3h, healthy_total_m3h = baseline.explained_flows(segments)
    healthy_variance = baseline.variances(
        _towards(healthy_flow_m3h, flow_m3h, baseline.flow_scatter),
        _towards(healthy_total_m3h, total_m3h, baseline.flow_scatter),
        level_m,
    )
    slope_variance = np.maximum(baseline.variances(flow_m3h, total_m3h, level_m) - healthy_variance, 0.0)
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = (
        _noise(shifts_m, baseline.noise(segments), baseline.correlation_factor)
        + baseline.run_covariance
        + np.diag(healthy_variance)
    )
    covariance[DRAWDOWN, DRAWDOWN] = reference.drawdown.variance
    covariance[POWER, POWER] = reference.power.variance
    speed_ratio = float(median(segments.speed_ratio))
    direction = flow_meter_direction(flow_m3h, flow_m3h * speed_ratio, total_m3h, curve, friction_h2_m5)
    head_direction = head_sensor_direction(speed_ratio)
    mean_m = median(shifts_m)
    system_in_pump = 0.0
    if run.lacks_head:
        system_in_pump = -1.0 / speed_ratio**2
        direction[PUMP] += system_in_pump * direction[SYSTEM]
        direction[SYSTEM] = direction[PUMP] / system_in_pump  # of the main, if it were the cause
        head_direction[:] = 0.0
        mean_m[SYSTEM] = math.nan
    drawdown = run.log_ratio - reference.drawdown.mean
    power = math.nan if run.lacks_head else log_power(run) - reference.power.mean
    return Observation(
        mean=np.array([*mean_m, drawdown, power]),
        covariance=covariance,
        slope_variance=slope_variance,
        flow_meter=np.array([*direction, 1.0, 0.0]),
        head_sensor=np.array([*head_direction, 0.0, 0.0]),
        system_in_pump=system_in_pump,
    )


def _towards(explained_m3h: float, measured_m3h: float, scatter: float) -> float:
    """The flow of a healthy pump that lies nearest to the measured one."""
    reach_m3h = scatter * explained_m3h
    return min(max(measured_m3h, explained_m3h - reach_m3h), explained_m3h + reach_m3h)


def _noise(shifts_m: Floats, covariance: Floats, correlation_factor: float) -> Floats:
    """Covariance of the median of the segments of a run, from that of one segment."""
    if len(shifts_m) >= MIN_STEPS:
        own = step_variance(shifts_m) * correlation_factor
        covariance = covariance * max(1.0, float((own / covariance.diagonal()).max()) / NOISIER_FACTOR)
    noise: Floats = covariance * (np.pi / 2.0 / len(shifts_m))
    return noise
