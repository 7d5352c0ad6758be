"""Probabilities before the next run: of each pump and its meters, and of the main that they share."""

from dataclasses import dataclass, field

import numpy as np

from wetwell.detector.inference.asset_belief import AssetBelief
from wetwell.detector.inference.posterior import BOTH, FLOW_METER, HEAD_SENSOR, PUMP_FAULT, SYSTEM_FAULT
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
    where runs tell them apart. `asset` is what is believed of the size of the fault.
    """

    pump: float = PUMP_PRIOR
    flow_meter: float = FLOW_METER_PRIOR
    head_sensor: float = HEAD_SENSOR_PRIOR
    pump_if_system: float | None = None
    asset: AssetBelief = field(default_factory=AssetBelief)


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


def update_prior(probability: Floats, pump: PumpPrior, system: SystemPrior, *, lacks_head: bool = False) -> None:
    """Take what a run has said into the priors, in place; a little is forgotten, so that nothing is ever certain."""
    faulty_system = probability[SYSTEM_FAULT] + probability[BOTH]
    pump.flow_meter = _mixed(probability[FLOW_METER], FLOW_METER_PRIOR)
    pump.head_sensor = _mixed(probability[HEAD_SENSOR], HEAD_SENSOR_PRIOR)
    system.system = _mixed(faulty_system, SYSTEM_PRIOR)
    if lacks_head:
        healthy = 1.0 - faulty_system - probability[PUMP_FAULT]
        joint = np.array([[healthy, probability[SYSTEM_FAULT]], [probability[PUMP_FAULT], probability[BOTH]]])
        joint = _change(PUMP_PRIOR) @ joint @ _change(SYSTEM_PRIOR).T
        pump.pump, pump.pump_if_system = (float(each) for each in joint[1] / joint.sum(axis=0))
    else:
        pump.pump, pump.pump_if_system = _mixed(probability[PUMP_FAULT] + probability[BOTH], PUMP_PRIOR), None


def _mixed(probability: float, prior: float) -> float:
    return float((1.0 - CHANGE_PER_RUN) * probability + CHANGE_PER_RUN * prior)


def _change(prior: float) -> Floats:
    """(2, 2) probability to be healthy or faulty in the next run, in columns for either now."""
    return np.array([[_mixed(1.0, 1.0 - prior), _mixed(0.0, 1.0 - prior)], [_mixed(0.0, prior), _mixed(1.0, prior)]])
