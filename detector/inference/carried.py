"""Faults as they were, in the terms of a run that comes next."""

import numpy as np
from scipy.special import ndtr

from wetwell.detector.inference.observation import PUMP, SYSTEM, Observation
from wetwell.detector.inference.posterior import FLOW_TRUST, Carried, Scales
from wetwell.detector.inference.prior import (
    CHANGE_PER_RUN,
    PUMP_PRIOR,
    SYSTEM_PRIOR,
    PumpPrior,
    SystemPrior,
    joint_prior,
)
from wetwell.protocols.arrays import Floats


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
    the next run against: that part of the probability is of a fault as new as any other. Without a head sensor no
    size is known, and nothing is carried.

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
    if observation.system_in_pump != 0.0 or friction_m <= 0.0:
        return joint_prior(pump, system), None
    disturbance = run_covariance.diagonal()
    own_m2 = observation.covariance.diagonal()[: SYSTEM + 1]
    lost_m, lost_m2 = pump.asset.track.foretold(time_ns, scales.pump_m, disturbance[PUMP])
    rise, variance = system.asset.track.foretold(
        time_ns, scales.system_m / friction_m, disturbance[SYSTEM] / friction_m**2
    )
    change_m = 0.5 * rise * (friction_m - (system.asset.friction_m or friction_m))
    mean_m = np.array([-lost_m, rise * friction_m - change_m])
    variance_m2 = np.array([lost_m2, variance * friction_m**2 + change_m**2])
    is_known = np.array([asset.track.time_ns is not None for asset in (pump.asset, system.asset)])
    meter_m = 2.0 * FLOW_TRUST * observation.flow_meter[: SYSTEM + 1]  # to one side when learnt, to the other now
    is_fault = is_known * _beyond(mean_m, variance_m2, np.hypot(np.sqrt(own_m2), meter_m))
    begun = CHANGE_PER_RUN * np.array([PUMP_PRIOR, SYSTEM_PRIOR])
    chance = np.array([pump.pump, system.system])
    share = np.maximum(chance - begun, 0.0) / chance * is_fault
    return joint_prior(pump, system), Carried(mean_m=mean_m, variance_m2=variance_m2, share=share)


def _beyond(mean: Floats, variance: Floats, limit: Floats) -> Floats:
    """Probability that what is known so lies beyond a limit, on either side."""
    deviation = np.sqrt(np.maximum(variance, 1e-300))
    return np.asarray(ndtr((-limit - mean) / deviation) + ndtr((mean - limit) / deviation))
