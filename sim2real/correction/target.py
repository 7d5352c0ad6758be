"""What a correction corrects: a term of the model, of all pumps and mains or of one."""

from typing import NamedTuple

import numpy as np

from wetwell.simulator.corrections.parts import INERTIA, LEVEL_BALANCE, TERMS, Term
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.parameters import PlantParameters

EFFECT_OF_A_CONSTANT: dict[Term, str] = {
    "head_loss": "friction_bias",
    "static_head": "static_head_bias",
    "inertia": "water_inertia",
    "pump_head": "pump_wear",
    "speed": "motor_slip",
    "flow_reading": "flow_meter_gain",
    "head_reading": "head_sensor_offset",
    "power": "power_meter_gain",
    "back_flow": "check_valve_leak",
    "level_balance": "unmetered_inflow",
    "sump_area": "sump_area_profile",
}
"""Effect of the library that a constant correction of a term is."""


class Target(NamedTuple):
    """A term, with the number of its only pump or main from 1, 0 for all, and how probable it is beforehand."""

    term: Term
    pump: int
    main: int
    log_prior: float

    @property
    def is_of_all(self) -> bool:
        """Whether all pumps and mains have it."""
        return self.pump == self.main == 0

    @property
    def effect_of_a_constant(self) -> str | None:
        """Effect of the library that a constant correction is; None where there is none, of this pump or main."""
        name = EFFECT_OF_A_CONSTANT.get(self.term)
        has_one_of_several = name is not None and {"pump", "main"} & EFFECTS[name].model_fields.keys()
        return name if self.is_of_all or has_one_of_several else None


def targets_of(plant: PlantParameters) -> list[Target]:
    """All that may be corrected at a station.

    Each term is as probable as another one. Of a term that several pumps or mains have, all of them together are as
    probable as one of them, and each one as another.
    """
    found: list[Target] = []
    log_term = -float(np.log(len(TERMS)))
    for number, term in enumerate(TERMS):
        of_pipe, of_station = number <= INERTIA, number >= LEVEL_BALANCE
        count = 1 if of_station else len(plant.mains) if of_pipe else len(plant.pumps)
        of_all = Target(term=term, pump=0, main=0, log_prior=log_term - (float(np.log(2.0)) if count > 1 else 0.0))
        found.append(of_all)
        for one in range(1, count + 1) if count > 1 else ():
            pump, main = (0, one) if of_pipe else (one, 0)
            log_prior = of_all.log_prior - float(np.log(count))
            found.append(Target(term=term, pump=pump, main=main, log_prior=log_prior))
    return found
