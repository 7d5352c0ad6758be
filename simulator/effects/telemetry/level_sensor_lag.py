"""A damped level sensor."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters, followed_share


class LevelSensorLag(Effect):
    r"""The level sensor follows with a first-order lag; the controller sees what it reads.

    $$\tau \frac{dy}{dt} = L - y$$

    Parameters
    ----------
    lag_s : float
        τ, time in which the reading makes up 63 % of a change; 0 is no effect. [s]

    References
    ----------
    .. [1] After J. P. Bentley, Principles of Measurement Systems: first-order elements.
    """

    component: ClassVar[Component] = "level_sensor"
    neutral: ClassVar[dict[str, float]] = {"lag_s": 0.0}

    name: Literal["level_sensor_lag"] = "level_sensor_lag"
    lag_s: Annotated[float, limits(0.0, 120.0, "s")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Damp the level."""
        followed = followed_share(self.lag_s)
        return parameters.with_sensors(lambda sensor: replace(sensor, followed=followed), "level_m")
