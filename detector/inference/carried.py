"""Faults as they were, in the terms of a run that comes next."""

import numpy as np
from scipy.special import ndtr

from wetwell.detector.inference.observation import PUMP, SYSTEM, Observation
from wetwell.detector.inference.posterior import FLOW_TRUST, SCALES, Carried, Scales
from wetwell.detector.inference.prior import (
    CHANGE_PER_RUN,
    PUMP_PRIOR,
    SYSTEM_PRIOR,
    PumpPrior,
    SystemPrior,
    joint_prior,
    kept_shares,
)
from wetwell.protocols.arrays import Floats

FORETOLD_SHARE = 0.5
"""Of faults that were there before: that they have grown as foretold. As even, that they have another size now."""


def carry(
    pump: PumpPrior,
    system: SystemPrior,
    observation: Observation,
    scales: Scales,
    run_covariance: Floats,
    friction_m: float,
    time_ns: int,
) -> tuple[Floats, Carried | None]:
    """(6,) prior of the hypotheses, and the faults that were there before.

    What is no larger than a run scatters by, or than a flow meter that wanders makes of health, is no size to hold
    the next run against: that part of the probability is of a fault as new as any other. Without a head sensor the
    sizes of pump and main are not known, only what both do together: the prior of each fault then holds already how
    much better that foretells the run than a new fault does.

    Parameters
    ----------
    pump, system
        Beliefs.
    observation : Observation
        Of the run that comes next.
    scales : Scales
    run_covariance : (2, 2) array
        Of what disturbs runs in health. [m²]
    friction_m : float
        Head of friction in health at the flow of the run. [m]
    time_ns : int
        Of the run.
    """
    disturbance = run_covariance.diagonal()
    if observation.system_in_pump != 0.0:
        gain = _foretelling_gain(pump, observation, scales, float(disturbance[PUMP]), time_ns)
        return joint_prior(pump, system) * (1.0 + kept_shares(pump, system) * (gain - 1.0)), None
    if friction_m <= 0.0:
        return joint_prior(pump, system), None
    lost_m, lost_m2 = pump.asset.track.foretold(time_ns, scales.pump_m, disturbance[PUMP])
    rise, variance = system.asset.track.foretold(
        time_ns, scales.system_m / friction_m, disturbance[SYSTEM] / friction_m**2
    )
    change_m = 0.5 * rise * (friction_m - (system.asset.friction_m or friction_m))
    mean_m = np.array([-lost_m, rise * friction_m - change_m])
    variance_m2 = np.array([lost_m2, variance * friction_m**2 + change_m**2])
    is_known = np.array([asset.track.time_ns is not None for asset in (pump.asset, system.asset)])
    is_fault = is_known * _beyond(mean_m, variance_m2, _healthy_reach_m(observation))
    begun = CHANGE_PER_RUN * np.array([PUMP_PRIOR, SYSTEM_PRIOR])
    chance = np.array([pump.pump, system.system])
    share = np.maximum(chance - begun, 0.0) / chance * is_fault
    return joint_prior(pump, system), Carried(mean_m=mean_m, variance_m2=variance_m2, share=share)


def _foretelling_gain(
    pump: PumpPrior, observation: Observation, scales: Scales, disturbance: float, time_ns: int
) -> float:
    """How much likelier what a run without a head shows is by a fault that was there before than by a new one."""
    if pump.shown.time_ns is None:
        return 1.0
    shift_m, own_m2 = observation.mean[PUMP], observation.covariance[PUMP, PUMP]
    below_m, variance_m2 = pump.shown.foretold(time_ns, scales.pump_m, disturbance)
    foretold_m2 = own_m2 + observation.slope_variance[PUMP] + variance_m2
    new_m2 = own_m2 + np.array(SCALES) * scales.pump_m**2
    as_foretold = np.exp(-0.5 * (shift_m + below_m) ** 2 / foretold_m2) / np.sqrt(foretold_m2)
    as_new = np.mean(np.exp(-0.5 * shift_m**2 / new_m2) / np.sqrt(new_m2))
    is_fault = _beyond(np.array(below_m), np.array(variance_m2), _healthy_reach_m(observation)[PUMP])
    return float(1.0 + FORETOLD_SHARE * is_fault * (as_foretold / max(as_new, 1e-300) - 1.0))


def _healthy_reach_m(observation: Observation) -> Floats:
    """(2,) shifts that a run scatters by, and that a flow meter which wanders makes of health. [m]."""
    meter_m = 2.0 * FLOW_TRUST * observation.flow_meter[: SYSTEM + 1]  # to one side when learnt, to the other now
    return np.asarray(np.hypot(np.sqrt(observation.covariance.diagonal()[: SYSTEM + 1]), meter_m))


def _beyond(mean: Floats, variance: Floats, limit: Floats) -> Floats:
    """Probability that what is known so lies beyond a limit, on either side."""
    deviation = np.sqrt(np.maximum(variance, 1e-300))
    return np.asarray(ndtr((-limit - mean) / deviation) + ndtr((mean - limit) / deviation))
