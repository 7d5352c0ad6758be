"""A run weighed by what is believed, and what is believed after it."""

import math
from dataclasses import dataclass

import numpy as np

from wetwell.detector.inference.asset_belief import AssetBelief
from wetwell.detector.inference.carried import carry
from wetwell.detector.inference.observation import PUMP, SYSTEM, Observation
from wetwell.detector.inference.posterior import FLOW_METER, HEAD_SENSOR, Posterior, Scales, posterior_of
from wetwell.detector.inference.prior import CHANGE_PER_RUN, PumpPrior, SystemPrior
from wetwell.detector.inference.size_track import SizeTrack
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import State
from wetwell.protocols.quantities import pump_column

MOST_LOG_ODDS = 2.0 * math.log(20.0)
"""So much at most is held against what comes next, of what has been said of friction or lift."""
FRICTION_SPREAD = 0.1
"""Runs of which the friction differs by this share tell it from a rise of the lift: no fault grows so in one run."""
PUMP_STATES: tuple[State, ...] = ("pump_fault", "pump_and_system_fault")
MAIN_STATES: tuple[State, ...] = ("system_fault", "pump_and_system_fault")


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatingPoint:
    """Where and when a run was.

    Attributes
    ----------
    time_ns : int
        Of its end.
    flow_m3h, head_m : float
        Q/N of the pump, and head.
    friction_m : float
        Head of friction in health at its flow.
    run_covariance : (2, 2) array
        Of what disturbs runs in health. [m²]
    """

    time_ns: int
    flow_m3h: float
    head_m: float
    friction_m: float
    run_covariance: Floats


@dataclass(frozen=True, slots=True)
class Weighed:
    """What a run shows, and how probable each cause is."""

    observation: Observation
    scales: Scales
    point: OperatingPoint
    posterior: Posterior

    @property
    def is_by_meter(self) -> bool:
        """Whether what it shows is rather that of a meter that is wrong."""
        return float(self.posterior.probability[FLOW_METER] + self.posterior.probability[HEAD_SENSOR]) > 0.5

    def meter_error(self, pump: int) -> dict[str, tuple[float, float]]:
        """The meter of a pump (from 0) that is wrong: its relative error, and the standard deviation of that."""
        weighed = self.posterior
        if weighed.probability[FLOW_METER] >= weighed.probability[HEAD_SENSOR]:
            return {pump_column(pump + 1, "flow_m3h"): (weighed.flow_error, weighed.flow_deviation)}
        head_m = max(abs(self.point.head_m), 1e-9)
        return {pump_column(pump + 1, "head_m"): (weighed.head_error_m / head_m, weighed.head_deviation_m / head_m)}


def weigh(
    observation: Observation, scales: Scales, pump: PumpPrior, system: SystemPrior, point: OperatingPoint
) -> Weighed:
    """Probability of each cause of what a run shows, with the faults that were there before."""
    prior, carried = carry(pump, system, observation, scales, point.run_covariance, point.friction_m, point.time_ns)
    return Weighed(observation, scales, point, posterior_of(observation, scales, prior, carried))


def believe(pump: AssetBelief, main: AssetBelief, weighed: Weighed, state: State, onset_ns: int) -> None:
    """Take a run into the beliefs over the sizes of both faults, in place.

    Parameters
    ----------
    pump, main : AssetBelief
    weighed : Weighed
        The run.
    state : State
        What is told of it.
    onset_ns : int
        When a fault that is told anew began.
    """
    if state == "sensor_fault" or weighed.is_by_meter:
        return
    assets = ((pump, PUMP_STATES), (main, MAIN_STATES))
    is_headless = weighed.observation.system_in_pump != 0.0
    changed = [asset.is_carried != (state in states) and state != "unknown" for asset, states in assets]
    if not is_headless or state in PUMP_STATES or state == "normal":
        by_main = _by_main(main, weighed) if is_headless and state in MAIN_STATES else (0.0, 0.0)
        _believe_pump(pump, weighed, by_main, is_headless=is_headless, is_sure=changed[0])
    if weighed.point.friction_m > 0.0 and (not is_headless or state in ("system_fault", "normal")):
        _believe_main(main, weighed, is_headless=is_headless, is_sure=changed[1])
    for asset, states in assets:
        if state in states:
            asset.tell(onset_ns)
        elif state != "unknown":
            asset.look()


def remember_shown(pump: PumpPrior, weighed: Weighed, state: State) -> None:
    """Take how far a run without a head lies below the baseline into the prior of its pump, in place.

    What is a meter's is no size that a fault may keep.
    """
    seen, point = weighed.observation, weighed.point
    if seen.system_in_pump == 0.0 or state == "sensor_fault" or weighed.is_by_meter:
        pump.shown = SizeTrack()
        return
    variance = float(seen.covariance[PUMP, PUMP] + seen.slope_variance[PUMP])
    disturbance = float(point.run_covariance[PUMP, PUMP])
    pump.shown.update(
        point.time_ns,
        -float(seen.mean[PUMP]),
        variance,
        weighed.scales.pump_m,
        disturbance,
        CHANGE_PER_RUN,
        is_sure=False,
    )


def _by_main(main: AssetBelief, weighed: Weighed) -> tuple[float, float]:
    """What its main adds to the loss of a pump that has no head sensor [m], and the variance of that [m²].

    By what the runs of the other pumps have told of the main: a run without a head shows the sum.
    """
    point, friction_m = weighed.point, weighed.point.friction_m
    if friction_m <= 0.0:
        return 0.0, 0.0
    disturbance = float(point.run_covariance[SYSTEM, SYSTEM]) / friction_m**2
    rise, variance = main.track.foretold(point.time_ns, weighed.scales.system_m / friction_m, disturbance)
    gain_m = -weighed.observation.system_in_pump * friction_m
    return gain_m * rise, gain_m**2 * variance


def _believe_pump(
    pump: AssetBelief, weighed: Weighed, by_main: tuple[float, float], *, is_headless: bool, is_sure: bool
) -> None:
    seen, point = weighed.observation, weighed.point
    value, variance = -seen.mean[PUMP], seen.covariance[PUMP, PUMP] + seen.slope_variance[PUMP]
    if is_headless:
        value = -weighed.posterior.shift_m[PUMP] - by_main[0]
        variance = weighed.posterior.deviation_m[PUMP] ** 2 + by_main[1]
    pump.scale, pump.flow_m3h = weighed.scales.pump_m, point.flow_m3h
    disturbance = float(point.run_covariance[PUMP, PUMP])
    pump.track.update(
        point.time_ns, float(value), float(variance), pump.scale, disturbance, CHANGE_PER_RUN, is_sure=is_sure
    )


def _believe_main(main: AssetBelief, weighed: Weighed, *, is_headless: bool, is_sure: bool) -> None:
    """Of a main the slope says nothing: where k is wrong by a share, rise and k are, and their ratio is right."""
    seen, point = weighed.observation, weighed.point
    shift_m, variance_m2 = seen.mean[SYSTEM], seen.covariance[SYSTEM, SYSTEM]
    if is_headless:
        shift_m, variance_m2 = weighed.posterior.shift_m[SYSTEM], weighed.posterior.deviation_m[SYSTEM] ** 2
    friction_m, variance = point.friction_m, float(variance_m2) / point.friction_m**2
    main.scale = weighed.scales.system_m / friction_m
    disturbance = float(point.run_covariance[SYSTEM, SYSTEM]) / friction_m**2
    value = float(shift_m) / friction_m
    if abs(main.friction_m / friction_m - 1.0) > FRICTION_SPREAD and main.friction_m > 0.0:
        rise, doubt = main.track.foretold(point.time_ns, main.scale, disturbance)
        total = doubt + variance
        as_static = rise * main.friction_m / friction_m
        main.log_static += ((value - rise) ** 2 - (value - as_static) ** 2) / (2.0 * total)
        main.log_static = float(np.clip(main.log_static, -MOST_LOG_ODDS, MOST_LOG_ODDS))
    main.friction_m = friction_m
    if main.track.update(point.time_ns, value, variance, main.scale, disturbance, CHANGE_PER_RUN, is_sure=is_sure):
        main.log_static = 0.0
