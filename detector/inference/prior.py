"""Probabilities before the next run: of each pump and its meters, and of the main that they share."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from wetwell.detector.inference.asset_belief import AssetBelief
from wetwell.detector.inference.posterior import BOTH, FLOW_METER, HEAD_SENSOR, PUMP_FAULT, SYSTEM_FAULT
from wetwell.detector.inference.size_track import SizeTrack
from wetwell.protocols.arrays import Floats

PUMP_PRIOR = 0.05
SYSTEM_PRIOR = 0.05
FLOW_METER_PRIOR = 0.01
HEAD_SENSOR_PRIOR = 0.005
CHANGE_PER_RUN = 0.05
"""Share of a prior that is forgotten from run to run: faults come and go."""


@dataclass(slots=True)
class PumpPrior:
    """Probabilities that a pump has a fault, and that its flow meter or its head sensor is wrong.

    `pump_if_system` is that of a pump fault in case that the system has one, and `pump` then in case that it has
    none: without a head sensor a run shows that one of them has a fault, and so each speaks against the other. None
    where runs tell them apart. `asset` is what is believed of the size of the fault; `shown`, of a pump without a
    head sensor, how far its runs lie below the baseline, whatever is the cause. [m]
    """

    pump: float = PUMP_PRIOR
    flow_meter: float = FLOW_METER_PRIOR
    head_sensor: float = HEAD_SENSOR_PRIOR
    pump_if_system: float | None = None
    asset: AssetBelief = field(default_factory=AssetBelief)
    shown: SizeTrack = field(default_factory=SizeTrack)


@dataclass(slots=True)
class SystemPrior:
    """Probability that the system has a fault, and how large it is: what one pump meets, the others will."""

    system: float = SYSTEM_PRIOR
    asset: AssetBelief = field(default_factory=AssetBelief)


def joint_prior(pump: PumpPrior, system: SystemPrior) -> Floats:
    """(6,) prior of the hypotheses; one meter at most is wrong, and then pump and system are not at fault."""
    p, s, q, h = pump.pump, system.system, pump.flow_meter, pump.head_sensor
    both = p if pump.pump_if_system is None else pump.pump_if_system
    healthy = (1.0 - p) * (1.0 - s)
    meters = 1.0 - q - h
    prior = np.array(
        [healthy * meters, p * (1.0 - s) * meters, (1.0 - both) * s * meters, both * s * meters, 0.0, 0.0]
    )
    prior[FLOW_METER], prior[HEAD_SENSOR] = healthy * q, healthy * h
    prior /= prior.sum()
    return prior


def kept_shares(pump: PumpPrior, system: SystemPrior) -> Floats:
    """(6,) share of the prior of each fault, and of the flow meter's, that was there before and is not a new one."""
    joint = _joint(pump, system.system)
    kept = _kept(PUMP_PRIOR) @ joint @ _kept(SYSTEM_PRIOR).T
    share = np.divide(np.maximum(kept, 0.0), joint, out=np.zeros((2, 2)), where=joint > 0.0)
    flow_meter = max(pump.flow_meter - CHANGE_PER_RUN * FLOW_METER_PRIOR, 0.0) / pump.flow_meter
    return np.array([0.0, share[1, 0], share[0, 1], share[1, 1], flow_meter, 0.0])


def update_prior(
    probability: Floats,
    pump: PumpPrior,
    system: SystemPrior,
    *,
    lacks_head: bool = False,
    siblings: Iterable[PumpPrior] = (),
) -> None:
    """Take what a run has said into the priors, in place; a little is forgotten, so that nothing is ever certain.

    Parameters
    ----------
    probability : (6,) array
        Of the hypotheses, after the run.
    pump, system
        Of the pump that has run, and of its main.
    lacks_head : bool
        Whether the run was judged without a head sensor.
    siblings : iterable of PumpPrior
        Of the other pumps on the main: that its fault may have gone is another case than that it never had one.
    """
    faulty_system = probability[SYSTEM_FAULT] + probability[BOTH]
    for sibling in siblings:
        if sibling.pump_if_system is not None:
            _set_joint(sibling, _joint(sibling, faulty_system) @ _change(SYSTEM_PRIOR).T)
    pump.flow_meter = _mixed(probability[FLOW_METER], FLOW_METER_PRIOR)
    pump.head_sensor = _mixed(probability[HEAD_SENSOR], HEAD_SENSOR_PRIOR)
    system.system = _mixed(faulty_system, SYSTEM_PRIOR)
    if lacks_head:
        healthy = 1.0 - faulty_system - probability[PUMP_FAULT]
        joint = np.array([[healthy, probability[SYSTEM_FAULT]], [probability[PUMP_FAULT], probability[BOTH]]])
        joint = _change(PUMP_PRIOR) @ joint @ _change(SYSTEM_PRIOR).T
        _set_joint(pump, joint)
    else:
        pump.pump, pump.pump_if_system = _mixed(probability[PUMP_FAULT] + probability[BOTH], PUMP_PRIOR), None


def _joint(pump: PumpPrior, faulty_system: float) -> Floats:
    """(2, 2) probability of pump (rows) and system (columns) to be healthy or at fault."""
    both = pump.pump if pump.pump_if_system is None else pump.pump_if_system
    at_fault = np.array([pump.pump, both])
    joint: Floats = np.array([1.0 - at_fault, at_fault]) * np.array([1.0 - faulty_system, faulty_system])
    return joint


def _set_joint(pump: PumpPrior, joint: Floats) -> None:
    pump.pump, pump.pump_if_system = (float(each) for each in joint[1] / joint.sum(axis=0))


def _mixed(probability: float, prior: float) -> float:
    return float((1.0 - CHANGE_PER_RUN) * probability + CHANGE_PER_RUN * prior)


def _change(prior: float) -> Floats:
    """(2, 2) probability to be healthy or faulty in the next run, in columns for either now."""
    return np.array([[_mixed(1.0, 1.0 - prior), _mixed(0.0, 1.0 - prior)], [_mixed(0.0, prior), _mixed(1.0, prior)]])


def _kept(prior: float) -> Floats:
    """(2, 2) takes off, from what is healthy or at fault, what has become so since the run before, in columns."""
    return np.eye(2) - CHANGE_PER_RUN * np.array([[1.0 - prior] * 2, [prior] * 2])
