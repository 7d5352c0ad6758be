"""A damped level sensor."""

from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import RESOLVED_S, Component, Effect, limits, of_channels
from wetwell.simulator.plant import PlantParameters


class LevelSensorLag(Effect):
    r"""The level sensor follows with a first-order lag; the controller sees what it reads.

    $$\tau \frac{dy}{dt} = L - y$$

    Parameters
    ----------
    lag_s : float
        τ; 0 is no effect. [s]

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
        return of_channels(parameters, "lag_s", "level_m", self.lag_s)

    def is_seen(self, parameters: PlantParameters) -> bool:  # noqa: ARG002 - the same on every plant
        """Whether the lag is a second or more."""
        return self.lag_s >= RESOLVED_S
