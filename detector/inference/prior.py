"""Probabilities before the next run: of each pump and its meters, and of the main that they share."""

from dataclasses import dataclass

import numpy as np

from wetwell.detector.inference.posterior import BOTH, FLOW_METER, HEAD_SENSOR, PUMP_FAULT, SYSTEM_FAULT
from wetwell.protocols.arrays import Floats

PUMP_PRIOR = 0.05
SYSTEM_PRIOR = 0.05
FLOW_METER_PRIOR = 0.01
HEAD_SENSOR_PRIOR = 0.005
CHANGE_PER_RUN = 0.05
"""Share of a prior that is forgotten from run to run: faults come and go."""
LEAST = 1e-6
"""Probability that nothing is taken to be less than, and its opposite."""


@dataclass(slots=True)
class PumpPrior:
    """Probabilities that a pump has a fault, and that its flow meter or its head sensor is wrong.

    `pump_if_system` is that of a pump fault in case that the system has one, and `pump` then in case that it has
    none: without a head sensor a run shows that one of them has a fault, and so each speaks against the other. None
    where runs tell them apart.
    """

    pump: float = PUMP_PRIOR
    flow_meter: float = FLOW_METER_PRIOR
    head_sensor: float = HEAD_SENSOR_PRIOR
    pump_if_system: float | None = None


@dataclass(slots=True)
class SystemPrior:
    """Probability that the system has a fault: what one pump meets, the others will."""

    system: float = SYSTEM_PRIOR


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
    """Take what a run has said into the priors, in place; a little is forgotten, so that nothing is ever certain.

    Without a head sensor a fault that goes on says nothing new of which it is, and nothing is forgotten.
    """
    faulty_system = probability[SYSTEM_FAULT] + probability[BOTH]
    forgotten = CHANGE_PER_RUN
    if lacks_head:
        forgotten *= 1.0 - probability[PUMP_FAULT] - faulty_system
        pump.pump = _mixed(probability[PUMP_FAULT] / max(1.0 - faulty_system, LEAST), PUMP_PRIOR, forgotten)
        pump.pump_if_system = _mixed(probability[BOTH] / max(faulty_system, LEAST), PUMP_PRIOR, forgotten)
    else:
        pump.pump = _mixed(probability[PUMP_FAULT] + probability[BOTH], PUMP_PRIOR, forgotten)
        pump.pump_if_system = None
    pump.flow_meter = _mixed(probability[FLOW_METER], FLOW_METER_PRIOR, forgotten)
    pump.head_sensor = _mixed(probability[HEAD_SENSOR], HEAD_SENSOR_PRIOR, forgotten)
    system.system = _mixed(faulty_system, SYSTEM_PRIOR, forgotten)


def _mixed(probability: float, prior: float, forgotten: float) -> float:
    return float(min(max((1.0 - forgotten) * probability + forgotten * prior, LEAST), 1.0 - LEAST))
