"""A level in steps."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class LevelQuantisation(Effect):
    r"""The recorded level is rounded to a step; the controller sees the level as it is read.

    $$y = q \left\lfloor \frac{L}{q} + \frac{1}{2} \right\rfloor$$

    Parameters
    ----------
    quantum_m : float
        q, step to which the level is rounded; 0 is no effect. [m]

    References
    ----------
    .. [1] After B. Widrow, I. Kollár, Quantization Noise, Cambridge University Press.
    """

    component: ClassVar[Component] = "level_sensor"
    neutral: ClassVar[dict[str, float]] = {"quantum_m": 0.0}

    name: Literal["level_quantisation"] = "level_quantisation"
    quantum_m: Annotated[float, limits(0.0, 0.5, "m")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Round the level."""
        return parameters.with_sensors(lambda sensor: replace(sensor, quantum=self.quantum_m), "level_m")
