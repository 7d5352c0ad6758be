"""A damped level sensor."""

from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.telemetry.damping import damped_by


class LevelSensorLag(Effect):
    r"""The level sensor follows with a lag of one filter, or of two; the controller sees what it reads.

    $$(1 - s)\, \tau\, \frac{dx}{dt} = L - x, \qquad s\, \tau\, \frac{dy}{dt} = x - y$$

    Parameters
    ----------
    lag_s : float
        τ, the time by which the reading comes late while the true value moves evenly; 0 is no effect. [s]
    second_share : float
        s, share of it that a second filter in a row takes: of transmitter and input card; 0 is one filter. [1]

    References
    ----------
    .. [1] After J. P. Bentley, Principles of Measurement Systems: first-order elements.
    """

    component: ClassVar[Component] = "level_sensor"
    neutral: ClassVar[dict[str, float]] = {"lag_s": 0.0}

    name: Literal["level_sensor_lag"] = "level_sensor_lag"
    lag_s: Annotated[float, limits(0.0, 120.0, "s")]
    second_share: Annotated[float, limits(0.0, 0.5, "1")] = 0.0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Damp the level."""
        return parameters.with_sensors(lambda sensor: damped_by(sensor, self.lag_s, self.second_share), "level_m")
